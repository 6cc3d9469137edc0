//! Loops of force over displacement of a joint, under the measured displacements.
//!
//! Springs and joints between the same two places act in parallel to the joint. A motion is
//! straight between two rows; laws that depend on velocity need the time of each row. Each group
//! is a separate record that begins unloaded.

use super::law_path::{LoadPath, forces_along};
use super::targets::{Fitted, MeasuredRows, RowStates, Target, TargetInput};
use crate::case::study::Case;
use crate::data::ColumnError;
use stickslip::dimension::Dimension;

/// Rows of a loop.
#[derive(Debug)]
pub(super) struct LoopTarget {
    joint: String,
    cycle: bool,
    /// The path of each group, in the order of the rows.
    paths: Vec<LoadPath>,
    measured: MeasuredRows,
}

impl LoopTarget {
    pub fn new(input: &TargetInput<'_>) -> Result<Self, ColumnError> {
        let displacement = input.column("displacement", Dimension::LENGTH)?;
        let forces = input.column("force", Dimension::FORCE)?;
        let time = input.optional_column("time", Dimension::TIME)?;
        let error = |message: String, help: &str| Err(ColumnError { message, help: help.to_owned() });
        let rows: Vec<usize> = (0..forces.len()).collect();
        let groups: Vec<&[usize]> = rows.chunk_by(|a, b| input.group(*a) == input.group(*b)).collect();
        if let Some(time) = &time
            && let Some(pair) =
                groups.iter().flat_map(|rows| rows.windows(2)).find(|pair| time[pair[0]] >= time[pair[1]])
        {
            let row = input.measured(pair[1], 0.0, 0.0, 1.0).row;
            return error(
                format!("the time in row {row} is not later than in the row before"),
                "sort the rows, or remove the column `time`",
            );
        }
        let model = &input.case.model;
        let joint = model.joints.iter().find(|joint| joint.name == input.at);
        if joint.is_some_and(|joint| joint.law.directions() > 1) {
            let help = "a loop has one displacement; use a law of one direction";
            return error(format!("the law of `{}` has several directions", input.at), help);
        }
        let deviations = input.deviations(&forces, Dimension::FORCE)?;
        let measured =
            (0..forces.len()).map(|i| input.measured(i, displacement[i], forces[i], deviations[i])).collect();
        let path = |rows: &&[usize]| LoadPath {
            displacement: rows.iter().map(|row| displacement[*row]).collect(),
            time: time.as_ref().map(|time| rows.iter().map(|row| time[*row]).collect()),
        };
        let target = LoopTarget {
            joint: input.at.to_owned(),
            cycle: input.values.flag("cycle") == Some(true),
            paths: groups.iter().map(path).collect(),
            measured: input.measured_rows(measured),
        };
        // a law that cannot follow a path is refused before the run
        target
            .fitted(input.case, &Vec::new())
            .map(|_| target)
            .map_err(|message| ColumnError { message, help: "add the column `time`, or use another target".to_owned() })
    }
}

impl Target for LoopTarget {
    fn abscissa(&self) -> &'static str {
        "displacement_m"
    }
    fn quantities(&self) -> Vec<String> {
        vec!["force_N".to_owned()]
    }
    fn measured(&self) -> &MeasuredRows {
        &self.measured
    }

    fn fitted(&self, case: &Case, _: &RowStates) -> Result<Fitted, String> {
        let joints = &case.model.joints;
        let Some(own) = joints.iter().find(|joint| joint.name == self.joint) else {
            return Err(format!("there is no joint `{}`", self.joint));
        };
        // an element between the same places in the other order has the opposite displacement
        let sign = |between: &[String; 2]| match between {
            [a, b] if [a, b] == [&own.between[0], &own.between[1]] => Some(1.0),
            [a, b] if [b, a] == [&own.between[0], &own.between[1]] => Some(-1.0),
            _ => None,
        };
        let mut values = Vec::with_capacity(self.measured.values.len());
        for path in &self.paths {
            let whole = if self.cycle { path.twice() } else { path.clone() };
            let skipped = whole.displacement.len() - path.displacement.len();
            let mut of_path = vec![0.0; path.displacement.len()];
            for joint in joints {
                let Some(sign) = sign(&joint.between) else { continue };
                let forces = forces_along(&*joint.law, &whole.scaled(sign))?;
                of_path.iter_mut().zip(&forces[skipped..]).for_each(|(value, force)| *value += sign * force);
            }
            for spring in case.model.springs.iter().filter(|spring| sign(&spring.between).is_some()) {
                let viscous = spring.damping != 0.0 && path.time.is_some();
                for (i, value) in of_path.iter_mut().enumerate() {
                    *value += spring.stiffness * path.displacement[i];
                    if viscous {
                        *value += spring.damping * path.velocity(i);
                    }
                }
            }
            values.extend(of_path);
        }
        Ok(Fitted { values, states: Vec::new() })
    }
}
