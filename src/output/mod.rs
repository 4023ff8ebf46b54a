// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a user looks at: ParaView series of cells and particles (`vtk`) and pictures of the particles
//! (`picture`), at the fluid's write times. Reads the step's fields; changes nothing.

pub mod picture;
pub mod restart;
pub mod vtk;

use crate::config::Config;
use crate::couple::Snapshot;
use picture::Camera;
use std::io;
use std::path::PathBuf;
use vtk::Data;

/// Files written at the fluid's write times.
pub struct Output {
    folder: PathBuf,
    cells: Option<vtk::Series>,
    grid: Option<vtk::Grid>,
    particles: Option<vtk::Series>,
    camera: Option<Camera>,
    suffix: String,
}

impl Output {
    /// Makes CASE/voidage if anything is to be written.
    ///
    /// `from`: fluid time of a restart (s); the series go on with it, the pictures begin anew under another name.
    pub fn new(c: &Config, from: Option<f64>) -> io::Result<Self> {
        let folder = c.folder.join("voidage");
        let o = &c.file.output;
        if o.fields || o.particles || o.picture != "none" {
            std::fs::create_dir_all(&folder)?;
        }
        let series = |on: bool, name: &str| on.then(|| vtk::Series::new(&folder, name, from));
        let axis = ["x", "y", "z"].iter().position(|a| *a == o.picture);
        Ok(Self {
            cells: series(o.fields, "cells"),
            grid: None,
            particles: series(o.particles, "particles"),
            camera: axis.map(Camera::new),
            folder,
            suffix: from.map(|t| format!("-from-{t}")).unwrap_or_default(),
        })
    }

    /// Writes one moment.
    pub fn write(&mut self, s: &Snapshot) -> io::Result<()> {
        let p = s.particles;
        if let Some(series) = &mut self.cells {
            let q = &s.step.sources;
            let fields = [
                ("voidage", Data::Scalar(&q.voidage)),
                ("solids_flux", Data::Vector(&q.solids_flux)),
                ("fluid_velocity", Data::Vector(&s.fluid.velocity)),
                ("momentum_exchange_coefficient", Data::Scalar(&q.sp)),
                ("momentum_source", Data::Vector(&q.su)),
            ];
            let grid = self.grid.get_or_insert_with(|| vtk::Grid::new(&s.step.mesh));
            series.write(s.time, "vtu", |file| grid.write(file, &fields))?;
        }
        if let Some(series) = &mut self.particles {
            let d = &s.step.drive;
            let id: Vec<f64> = p.id.iter().map(|i| *i as f64).collect();
            let fields = [
                ("id", Data::Scalar(&id)),
                ("radius", Data::Scalar(&p.radius)),
                ("velocity", Data::Vector(&p.velocity)),
                ("drag_coefficient", Data::Scalar(&d.drag_coefficient)),
                ("fluid_velocity", Data::Vector(&d.velocity)),
            ];
            series.write(s.time, "vtp", |file| vtk::points(file, &p.position, &fields))?;
        }
        if let Some(camera) = &mut self.camera {
            camera.take(s.time, s.step.mesh.bounds, p);
        }
        Ok(())
    }

    /// At the end of the run: the animation.
    pub fn finish(&mut self) -> io::Result<()> {
        match &self.camera {
            Some(camera) => {
                camera.save_last(&self.folder.join("bed.png"))?;
                camera.save_animation(&self.folder.join(format!("bed-animation{}.png", self.suffix)))
            }
            None => Ok(()),
        }
    }
}
