// SPDX-License-Identifier: MIT OR Apache-2.0
//! Writes the bench's bed as an OpenFOAM case and prints the PCG iterations of the implicit baselines on it:
//! `cargo run --example baseline -- FOLDER CELLS`, used by tests/openfoam-pcg/check.

use std::fs;
use std::path::Path;
use voidage::bench::{scene, smoother};
use voidage::smooth::{Diffusion, Implicit};

fn header(class: &str, object: &str) -> String {
    format!("FoamFile {{ version 2.0; format ascii; class {class}; object {object}; }}\n")
}

fn main() -> Result<(), String> {
    let usage = "type: cargo run --example baseline -- FOLDER CELLS";
    let (folder, cells) = (std::env::args().nth(1).ok_or(usage)?, std::env::args().nth(2).ok_or(usage)?);
    let (folder, cells) = (Path::new(&folder), cells.parse().map_err(|e| format!("{cells}: {e}; {usage}"))?);
    let mesh = scene::mesh(scene::BOX, cells);
    let lines = scene::lines(scene::BOX, cells);
    let (raw, _) = smoother::fields(&mesh, 0.25)?;
    let b = 4.0 * mesh.volume[0].cbrt();
    let write = |at: &str, text: String| {
        let at = folder.join(at);
        fs::create_dir_all(at.parent().unwrap_or(folder)).map_err(|e| e.to_string())?;
        fs::write(&at, text).map_err(|e| format!("{}: {e}", at.display()))
    };
    let [x, y, z] = scene::BOX;
    let [i, j, k] = lines;
    write(
        "system/blockMeshDict",
        header("dictionary", "blockMeshDict")
            + &format!(
                "vertices ((0 0 0) ({x} 0 0) ({x} {y} 0) (0 {y} 0) (0 0 {z}) ({x} 0 {z}) ({x} {y} {z}) (0 {y} {z}));\n\
                 blocks (hex (0 1 2 3 4 5 6 7) ({i} {j} {k}) simpleGrading (1 1 1));\n\
                 defaultPatch {{ type wall; name walls; }}\nboundary ();\n"
            ),
    )?;
    write(
        "system/controlDict",
        header("dictionary", "controlDict")
            + &format!(
                "startFrom startTime; startTime 0; stopAt endTime; endTime 1; deltaT 1; writeInterval 1;\ndiffusion {:e};\n",
                0.25 * b * b
            ),
    )?;
    let field = |name: &str, value: &dyn Fn(usize) -> f64| {
        let values: String = (0..mesh.len()).map(|c| format!("{:e}\n", value(c))).collect();
        let text = format!(
            "dimensions [0 0 0 0 0 0 0];\ninternalField nonuniform List<scalar>\n{}\n(\n{values});\n\
             boundaryField {{ \".*\" {{ type zeroGradient; }} }}\n",
            mesh.len()
        );
        write(&format!("0/{name}"), header("volScalarField", name) + &text)
    };
    field("where", &|c| mesh.centre[c][0] + 10.0 * mesh.centre[c][1] + 100.0 * mesh.centre[c][2])?;
    for l in 0..7 {
        field(&format!("f{l}"), &|c| raw[c][l])?;
    }
    let t = Diffusion::uniform(b).links(&mesh);
    for (name, steps, theta) in [("crank-nicolson", 3, 0.5), ("constdiff", 1, 1.0)] {
        let mut solver = Implicit::new(name, &mesh, &t, steps, theta, 1e-6);
        for l in 0..7 {
            let mut x: Vec<f64> = raw.iter().map(|v| v[l]).collect();
            for (step, n) in solver.solve(&mut x).iter().enumerate() {
                println!("COUNT {steps} {l} {step} {n}");
            }
        }
    }
    Ok(())
}
