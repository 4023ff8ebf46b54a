// SPDX-License-Identifier: MIT OR Apache-2.0
//! `include/voidage.h` is what cbindgen makes of the source.

#[test]
fn the_header_is_current() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).unwrap();
    let sources = ["src/numbers.rs", "src/interface.rs"];
    let builder =
        sources.iter().fold(cbindgen::Builder::new().with_config(config), |b, s| b.with_src(root.join(s)));
    let mut made = Vec::new();
    builder.generate().unwrap().write(&mut made);
    let (made, file) = (String::from_utf8(made).unwrap(), root.join("include/voidage.h"));
    if std::env::var_os("VOIDAGE_WRITE_HEADER").is_some() {
        std::fs::write(&file, &made).unwrap();
    }
    let kept = std::fs::read_to_string(&file).unwrap();
    assert!(
        kept == made,
        "include/voidage.h is stale: VOIDAGE_WRITE_HEADER=1 cargo test -p voidage-client --test header"
    );
}
