// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a user looks at: ParaView series of cells and particles (`vtk`) and pictures of the particles
//! (`picture`), at the fluid's write times. Reads the step's fields; changes nothing.

pub mod export;
pub mod parquet;
pub mod picture;
pub mod restart;
pub mod vtk;

use crate::config::Config;
use crate::couple::Snapshot;
use crate::mesh::Mesh;
use crate::particles::Particles;
use crate::step::{Drive, Fluid, Sources};
use picture::Camera;
use std::io;
use std::path::PathBuf;
use vtk::Data;

/// All there is to see of an exchange; SI units.
#[allow(missing_docs)]
pub struct Fields<'a> {
    pub mesh: &'a Mesh,
    pub sources: &'a Sources,
    pub fluid: &'a Fluid,
    pub particles: &'a Particles,
    pub drive: &'a Drive,
}

impl Fields<'_> {
    /// Fields of the cells by name.
    pub fn cells(&self) -> Vec<(&'static str, Data<'_>)> {
        let q = self.sources;
        vec![
            ("voidage", Data::Scalar(&q.voidage)),
            ("solids_flux", Data::Vector(&q.solids_flux)),
            ("fluid_velocity", Data::Vector(&self.fluid.velocity)),
            ("momentum_exchange_coefficient", Data::Scalar(&q.sp)),
            ("momentum_source", Data::Vector(&q.su)),
        ]
    }
    /// Ids as numbers.
    pub fn ids(&self) -> Vec<f64> {
        self.particles.id.iter().map(|i| *i as f64).collect()
    }
    /// Fields of the particles by name; those of the drive only where there is one.
    pub fn points<'b>(&'b self, id: &'b [f64]) -> Vec<(&'static str, Data<'b>)> {
        let (p, d) = (self.particles, self.drive);
        let mut list = vec![
            ("id", Data::Scalar(id)),
            ("radius", Data::Scalar(&p.radius)),
            ("velocity", Data::Vector(&p.velocity)),
        ];
        if d.drag_coefficient.len() == p.len() {
            list.push(("drag_coefficient", Data::Scalar(&d.drag_coefficient)));
            list.push(("fluid_velocity", Data::Vector(&d.velocity)));
        }
        list
    }
}

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
        let (mesh, sources, drive) = (&s.step.mesh, &s.step.sources, &s.step.drive);
        let all = Fields { mesh, sources, drive, fluid: s.fluid, particles: p };
        if let Some(series) = &mut self.cells {
            let grid = self.grid.get_or_insert_with(|| vtk::Grid::new(mesh));
            series.write(s.time, "vtu", |file| grid.write(file, &all.cells()))?;
        }
        if let Some(series) = &mut self.particles {
            let id = all.ids();
            series.write(s.time, "vtp", |file| vtk::points(file, &p.position, &all.points(&id)))?;
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
