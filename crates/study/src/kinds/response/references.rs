//! The linear references of a response: the same structure with all joints free, and with all
//! joints stuck.

use crate::case::linear_reference::LinearReference;
use crate::case::study::{Case, Study};
use crate::case::values::hertz;
use crate::results::columns::{FREQUENCY as DRIVE, amplitude_in};
use crate::results::notes::WARNING;
use crate::results::table_builder::TableBuilder;
use crate::run::work::{PreparedCase, UnitTask};
use stickslip::method::{self, MethodError, Options, Solver};
use stickslip::model::System;
use stickslip::orbit::Orbit;

/// Points of the linear references per interval of the curve; their peaks are sharper than
/// those of damped curves.
pub(super) const REFERENCE_POINTS: usize = 4;

/// Returns true if the previous case has the same references: linear structures, excitation and
/// frequencies are equal.
pub(super) fn equal_previous(study: &Study, case: &Case) -> bool {
    let before = case.index.checked_sub(1).and_then(|index| study.case(index).ok());
    before.is_some_and(|before| {
        let is_equal = |reference: LinearReference| match (reference.model(&before.model), reference.model(&case.model))
        {
            (Ok(before), Ok(case)) => before == case,
            (before, case) => before.is_err() && case.is_err(),
        };
        before.frequencies == case.frequencies && LinearReference::ALL.into_iter().all(is_equal)
    })
}

/// Estimates the number of cases with different references, from some of the cases; zero if
/// none are requested.
pub(super) fn distinct_cases(study: &Study) -> f64 {
    if !study.wants_references() {
        return 0.0;
    }
    // Number of cases examined to estimate the number of references.
    let (cases, looked) = (study.cases(), study.cases().min(9));
    let sampled = (0..looked).filter_map(|i| study.case(i * cases / looked).ok());
    let own = sampled.filter(|case| !equal_previous(study, case)).count();
    own as f64 * cases as f64 / looked as f64
}

/// Returns a solver of a linear reference.
///
/// Its joints have other laws than those for which the method was chosen. If that method does
/// not support them, the first method that does is used.
fn solver<'a>(prepared: &PreparedCase, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
    prepared.method.solver(system).or_else(|error| {
        let others = method::alternatives(system).methods.into_iter().filter_map(method::find);
        let mut takes = others.filter_map(|row| (row.build)(&Options::new()).ok()?.solver(system).ok());
        takes.next().ok_or(error)
    })
}

/// Returns the responses with all joints free and with all joints stuck, and the reasons for
/// missing ones.
pub(super) fn references(work: &UnitTask<'_>, omegas: &[f64]) -> (TableBuilder, Vec<String>) {
    let prepared = work.case();
    let between = omegas.windows(2).flat_map(|pair| {
        (0..REFERENCE_POINTS).map(|i| pair[0] + (pair[1] - pair[0]) * i as f64 / REFERENCE_POINTS as f64)
    });
    let omegas: Vec<f64> = between.chain(omegas.last().copied()).collect();
    let mut absent = Vec::new();
    // only the amplitudes are kept: an orbit with many places takes megabytes
    let amplitudes = |orbit: Orbit| orbit.places.iter().map(|place| place.amplitude()).collect::<Vec<f64>>();
    let mut follow = |reference: LinearReference| -> Option<Vec<Option<Vec<f64>>>> {
        // the check of the study reports laws without a reference
        let mut model = reference.model(&prepared.case.model).ok()?;
        // Constant forces only move the means. A structure that its joints alone hold against them
        // has amplitudes without them.
        model.forces.iter_mut().filter(|force| force.harmonic == 0).for_each(|force| force.amplitude = 0.0);
        let found = model.assemble().map_err(|error| error.to_string()).and_then(|system| {
            let mut solver = solver(prepared, &system).map_err(|error| error.to_string())?;
            Ok(omegas.iter().map(|omega| solver.orbit(*omega).map(amplitudes)).collect::<Vec<_>>())
        });
        let orbits = found.map_err(|why| absent.push(format!("{WARNING}{}", reference.no_reference(&why)))).ok()?;
        if let (true, Some(Err(error))) = (orbits.iter().all(Result::is_err), orbits.first()) {
            absent.push(format!("{WARNING}{}", reference.no_reference(&error.to_string())));
        }
        Some(orbits.into_iter().map(Result::ok).collect())
    };
    let curves = LinearReference::ALL.map(|reference| (reference.name(), follow(reference)));
    let mut rows = TableBuilder::for_linear_motions();
    for (i, omega) in omegas.iter().enumerate() {
        rows.varied(&prepared.case);
        rows.number(DRIVE, hertz(*omega));
        for (what, curve) in &curves {
            for (place, (name, along)) in prepared.system.places().iter().zip(prepared.system.place_axes()).enumerate()
            {
                let point = curve.as_ref().and_then(|curve| curve[i].as_ref());
                let amplitude = point.map_or(f64::NAN, |amplitudes| amplitudes[place]);
                rows.number(&amplitude_in(&format!("{name}_{what}"), along.unit()), amplitude);
            }
        }
        rows.reduction_error(prepared.system.reduction_evidence());
        rows.end_row();
    }
    (rows, absent)
}
