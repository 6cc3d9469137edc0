//! The system as the event-driven method sees it: masses, springs, ideal sliders, one drive frequency.

use crate::method::MethodError;
use crate::model::System;
use nalgebra::{DMatrix, DVector};

/// One ideal slider, rigid or behind a spring.
#[derive(Debug, Clone)]
pub(crate) struct Slider {
    /// The joint it belongs to.
    pub joint: usize,
    /// Direction, length n.
    pub direction: DVector<f64>,
    /// Spring in front of it, N/m.
    pub stiffness: Option<f64>,
    /// Slip limit, N.
    pub limit: f64,
    /// Index of its force among the states, for a slider behind a spring.
    pub state: Option<usize>,
}

/// Matrices and sliders; independent of the drive frequency.
#[derive(Debug, Clone)]
pub(crate) struct Mechanics {
    pub n: usize,
    pub mass: DMatrix<f64>,
    pub inverse_mass: DMatrix<f64>,
    pub damping: DMatrix<f64>,
    pub stiffness: DMatrix<f64>,
    pub sliders: Vec<Slider>,
    /// Number of sliders behind springs.
    pub elastic: usize,
    /// Estimate of the fastest natural frequency, rad/s.
    pub fastest: f64,
}

impl Mechanics {
    /// # Errors
    /// A joint whose law has no exact view, or that acts in more than one direction; a place without mass.
    pub fn new(system: &System) -> Result<Self, MethodError> {
        let n = system.dofs();
        if let Some(i) = (0..n).find(|&i| system.structure().mass()[(i, i)] <= 0.0) {
            return Err(MethodError::NeedsMass { method: super::NAME, place: system.places()[i].clone() });
        }
        let mut sliders = Vec::new();
        let mut elastic = 0;
        for (j, joint) in system.joints().iter().enumerate() {
            let unsupported = |instead: &'static str| MethodError::Law {
                method: super::NAME,
                joint: joint.name().to_owned(),
                law: joint.law().name(),
                instead,
            };
            let branches = joint.law().sliders().ok_or_else(|| unsupported("method `shooting`, or the exact law"))?;
            if joint.axes().len() != 1 {
                return Err(unsupported("a law with one direction"));
            }
            for branch in branches {
                let state = branch.stiffness.map(|_| {
                    elastic += 1;
                    elastic - 1
                });
                sliders.push(Slider {
                    joint: j,
                    direction: joint.axes()[0].dense(n),
                    stiffness: branch.stiffness,
                    limit: branch.limit,
                    state,
                });
            }
        }
        let positive = system.structure().mass().clone().cholesky().is_some();
        let inverse_mass = system
            .structure()
            .mass()
            .clone()
            .try_inverse()
            .filter(|inverse| positive && inverse.iter().all(|x| x.is_finite()))
            .ok_or(MethodError::NotPositive { method: super::NAME, matrix: "mass" })?;
        let fastest = (0..n)
            .map(|i| (system.structure().stiffness()[(i, i)] / system.structure().mass()[(i, i)]).sqrt())
            .fold(0.0, f64::max);
        Ok(Mechanics {
            n,
            fastest,
            mass: system.structure().mass().clone(),
            inverse_mass,
            damping: system.structure().damping().clone(),
            stiffness: system.structure().stiffness().clone(),
            sliders,
            elastic,
        })
    }

    /// The joint of every slider.
    pub fn owners(&self) -> Vec<usize> {
        self.sliders.iter().map(|slider| slider.joint).collect()
    }

    /// Length of the state `(x, v, forces of sliders behind springs)`.
    pub fn states(&self) -> usize {
        2 * self.n + self.elastic
    }
}
