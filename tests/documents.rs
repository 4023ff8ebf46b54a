// SPDX-License-Identifier: MIT OR Apache-2.0
//! Documents name what exists.

use std::path::Path;

#[test]
fn every_path_in_the_architecture_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    // fenced blocks hold the picture
    let text: String = text.split("```").step_by(2).collect();
    let paths: Vec<_> = text.split('`').skip(1).step_by(2).filter(|p| p.contains('/')).collect();
    assert!(paths.len() > 20);
    for p in paths {
        assert!(root.join(p).exists(), "ARCHITECTURE.md names {p}");
    }
}

#[test]
fn every_key_of_a_case_is_explained() {
    let file = "format = 1\n[fluid]\ndensity = 1\nkinematic_viscosity = 1\ngravity = [0, 0, 0]\n[dem]\nscript = \"x\"\n\
                time_step = 1\n[coupling]\ninterval = 1\n[smooth]\n[forces]\ndrag = \"none\"\n";
    let file: voidage::config::CaseFile = toml::from_str(file).unwrap();
    let table = toml::Table::try_from(&file).unwrap();
    for (section, value) in &table {
        let keys: Vec<_> = value
            .as_table()
            .map(|t| t.keys().map(|k| format!("{section}.{k}")).collect())
            .unwrap_or_default();
        for key in keys {
            assert!(voidage::config::KEYS.iter().any(|k| k.0 == key), "{key}");
        }
    }
}
