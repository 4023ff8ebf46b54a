//! step
fn main() {
    let list: &[(usize, usize)] = &[(332_000, 166_000), (332_640, 20_700)];
    for (particles, cells) in list {
        let c = voidage::bench::step::Case {
            particles: *particles,
            cells: *cells,
            bandwidth: 4.8e-3,
            tolerance: 1e-2,
            drag: "koch-hill",
            mapping: "particle-centroid",
            repetitions: 12,
        };
        println!("{:#?}", voidage::bench::step::run(&c).unwrap());
    }
    println!(
        "triad 16 MB {:.1} GB/s, 256 MB {:.1}",
        voidage::bench::triad::bandwidth(16 << 20, 1, 20),
        voidage::bench::triad::bandwidth(256 << 20, 1, 5)
    );
}
