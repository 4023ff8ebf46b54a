//! memory
fn main() {
    let n: Vec<usize> = std::env::args().skip(1).map(|x| x.parse().unwrap()).collect();
    let c = voidage::bench::step::Case {
        particles: n[0],
        cells: n[1],
        bandwidth: 4.8e-3,
        tolerance: 1e-2,
        drag: "koch-hill",
        mapping: "particle-centroid",
        repetitions: 3,
    };
    voidage::bench::step::run(&c).unwrap();
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    status.lines().filter(|l| l.starts_with("VmHWM") || l.starts_with("VmRSS")).for_each(|l| println!("{l}"));
}
