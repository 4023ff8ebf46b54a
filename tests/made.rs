// SPDX-License-Identifier: MIT OR Apache-2.0
//! Made meshes: they fill the box, fit together, and are the same mesh however they are cut.

use voidage::locate::Locator;
use voidage::mesh::made::{Made, Shape};
use voidage::mesh::{Mesh, NONE, assemble};

const SIZE: [f64; 3] = [0.06, 0.04, 0.05];

fn meshes() -> Vec<Made> {
    let mut list = Vec::new();
    for shape in [Shape::Hex, Shape::Tet, Shape::Poly] {
        for cyclic in [[false; 3], [true, false, false], [true, false, true], [true; 3]] {
            list.push(Made::new(shape, [4, 3, 5], SIZE).cyclic(cyclic));
        }
    }
    list.push(Made::graded([6, 3, 5], SIZE));
    list.push(Made::hex([4, 5, 3], SIZE).jiggled(0.3));
    list.push(Made::tet([3, 3, 4], SIZE));
    list
}

fn same(a: &Mesh, b: &Mesh) {
    assert_eq!((&a.ids, &a.centre, &a.volume), (&b.ids, &b.centre, &b.volume));
    assert_eq!((&a.sides, &a.links, &a.patch_names), (&b.sides, &b.links, &b.patch_names));
}

#[test]
fn they_fill_the_box_and_do_not_depend_on_the_cut() {
    for made in meshes() {
        let mesh = made.mesh();
        assert_eq!(mesh.len(), made.cells());
        let volume: f64 = mesh.volume.iter().sum();
        assert!((volume / SIZE.iter().product::<f64>() - 1.0).abs() < 1e-12, "{made:?}: {volume}");
        let walls = mesh.sides.iter().filter(|s| s.across == NONE).count();
        assert_eq!(walls == 0, made.cyclic == [true; 3], "{made:?}");
        same(&mesh, &assemble(&made.pieces(2, |c| usize::from(c[0] > 0.028))).unwrap());
        same(&mesh, &assemble(&made.pieces(3, |c| (c[2] / 0.012) as usize % 3)).unwrap());
        for (i, row) in (0..mesh.len()).map(|i| (i, mesh.links(i))) {
            for l in row {
                let back = mesh.links(l.to as usize).iter().filter(|b| b.to as usize == i);
                assert!(back.map(|b| b.weight).any(|w| (w / l.weight - 1.0).abs() < 1e-9), "{made:?}");
            }
        }
    }
}

#[test]
fn points_are_found_in_them() {
    for made in meshes().into_iter().filter(|m| m.shape != Shape::Hex || m.jiggle == 0.0) {
        let mesh = made.mesh();
        let mut seed = 1u64;
        let mut x: Vec<[f64; 3]> = (0..500)
            .map(|_| {
                SIZE.map(|s| {
                    seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    s * (seed >> 11) as f64 / (1u64 << 53) as f64
                })
            })
            .collect();
        let mut host = vec![NONE; x.len()];
        Locator::new(&mesh)
            .locate(&mesh, &mut x, &mut host)
            .unwrap_or_else(|l| panic!("{made:?}: {:?}", l[0]));
    }
}
