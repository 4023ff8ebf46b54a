// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage report` and `voidage stability` on a recording of the test data: what is written is whole and needs nothing else.

mod common;

use common::folder::Folder;
use std::path::Path;
use voidage::commands::{BAD_INPUT, OK, report, stability, tune};

fn recording() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/recordings/whole.voidage")
}

fn write(file: &Path, into: &Path, tune: Option<&Path>, stability: Option<&Path>) -> u8 {
    report::report(file, &report::Options { into: Some(into), accuracy: 1e-2, tune, stability })
}

/// Every tag that opens closes, in order.
fn well_formed(page: &str) {
    let mut open = Vec::new();
    let void = ["meta", "link", "img", "br", "!DOCTYPE"];
    for tag in page.split('<').skip(1) {
        let (tag, _) = tag.split_once('>').unwrap_or_else(|| panic!("no end of <{tag}"));
        let name = tag.trim_start_matches('/').split([' ', '/', '\n']).next().unwrap().to_string();
        if tag.starts_with('/') {
            assert_eq!(open.pop().as_ref(), Some(&name), "</{name}>");
        } else if !tag.ends_with('/') && !void.contains(&name.as_str()) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn a_report_is_one_page_that_fetches_nothing() {
    let folder = Folder::new("report");
    let json = folder.path().join("stability.json");
    let options = stability::Options {
        set: &[],
        exchange: None,
        scheme: Some("explicit"),
        map: Some(folder.path()),
        json: Some(&json),
    };
    assert_eq!(stability::stability(&recording(), &options), OK);
    let growth: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    assert_eq!(growth["growth"].as_array().unwrap().len(), 2, "free and held");
    assert!(growth["growth"][1]["limit_s"].as_f64().unwrap() > 0.0, "{growth}");
    assert!(folder.path().join("stability-held.svg").is_file());

    let tuned = folder.path().join("tune.json");
    let (set, only) = ([], ["smoother".to_string()]);
    let (write_to, json_to, all) = (None, Some(tuned.as_path()), false);
    let ask = tune::Options {
        set: &set,
        accuracy: 1e-3,
        exchanges: 3,
        only: &only,
        write: write_to,
        json: json_to,
        all,
    };
    assert_eq!(tune::tune(&recording(), &ask), OK);
    assert_eq!(write(&recording(), folder.path(), Some(&tuned), Some(&json)), OK);
    let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    well_formed(&page);
    for what in [
        "Run",
        "Conservation",
        "Voidage",
        "Time",
        "What is modelled",
        "Speed and accuracy",
        "Stability",
        "Settings",
    ] {
        assert!(page.contains(&format!("<h2>{what}</h2>")), "{what}");
    }
    let addresses = page.replace("http://www.w3.org/2000/svg", "");
    assert!(
        !addresses.contains("http") && !page.contains("<script") && !page.contains("NaN"),
        "fetches nothing"
    );
    assert!(page.matches("src=\"data:image/png;base64,").count() == 4, "three slices and their colours");
    assert!(page.matches("<svg").count() >= 5 && page.contains(">explicit</td>"));
    assert!(page.contains("<td>chosen</td>") && page.contains("[smooth]"), "what tune chose");
    for name in ["conservation.svg", "time.svg", "tuning.svg", "stability-free.svg", "solid-fraction-xy.png"]
    {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
}

#[test]
fn what_is_no_run_is_named() {
    let folder = Folder::new("no-report");
    assert_eq!(write(folder.path(), folder.path(), None, None), BAD_INPUT);
    assert_eq!(write(&folder.path().join("none.voidage"), folder.path(), None, None), BAD_INPUT);
    let other = folder.path().join("other.json");
    std::fs::write(&other, "{}").unwrap();
    assert_eq!(write(&recording(), folder.path(), None, Some(&other)), BAD_INPUT);
    assert_eq!(write(&recording(), folder.path(), Some(&other), None), BAD_INPUT);
    let options =
        stability::Options { set: &[], exchange: Some(77), scheme: Some("explicit"), map: None, json: None };
    assert_eq!(stability::stability(&recording(), &options), BAD_INPUT);
    assert_eq!(
        stability::stability(&recording(), &stability::Options { scheme: Some("none"), ..options }),
        BAD_INPUT
    );
}
