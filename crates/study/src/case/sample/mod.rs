//! `[sample]`: uncertain parameters, drawn at random.
//!
//! - `distribution`: distributions by their quantiles;
//! - `design`: the points of the draws in the unit cube.

mod design;
mod distribution;

pub(crate) use design::{DESIGNS, Design, MAX_SOBOL};
pub(crate) use distribution::{DISTRIBUTIONS, Distribution, WITHIN};

use crate::compile::compiled::{CompiledQuantity, Environment};
use crate::syntax::error::Problem;
use crate::syntax::expression::ExpressionValue;
use stickslip::dimension::Dimension;

/// The sampling of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SampleSettings {
    pub count: usize,
    pub seed: u64,
    pub design: Design,
}

/// An uncertain parameter.
#[derive(Debug, Clone)]
pub(crate) struct DrawnParameter {
    pub sample: SampleSettings,
    /// Index of its coordinate in the draws.
    pub coordinate: usize,
    /// The distribution, a name of [`DISTRIBUTIONS`], and its numbers.
    pub distribution: &'static str,
    pub numbers: Vec<CompiledQuantity>,
    pub within: Option<[CompiledQuantity; 2]>,
}

impl DrawnParameter {
    /// Iterates over its numbers and bounds.
    pub fn quantities(&self) -> impl Iterator<Item = &CompiledQuantity> {
        self.numbers.iter().chain(self.within.iter().flatten())
    }

    /// Returns the value of the parameter `name` in draw `index`.
    pub fn value(
        &self,
        name: &str,
        dimension: Option<Dimension>,
        index: usize,
        environment: &Environment<'_>,
    ) -> Result<ExpressionValue, Problem> {
        let mut dimension = dimension;
        let mut number = |quantity: &CompiledQuantity| {
            let value = quantity.parameter_value(name, dimension, environment)?;
            dimension = dimension.or(value.dimension);
            if value.si.is_finite() { Ok(value.si) } else { Err(quantity.problem(name, "this is not a finite number")) }
        };
        let numbers = self.numbers.iter().map(&mut number).collect::<Result<Vec<f64>, Problem>>()?;
        let distribution = Distribution::new(self.distribution, &numbers).map_err(|(at, message)| {
            self.numbers[at.min(self.numbers.len() - 1)].problem(self.distribution, message)
        })?;
        let p = self.sample.design.coordinate(self.sample.seed, index, self.sample.count, self.coordinate);
        let si = match &self.within {
            None => distribution.quantile(p),
            Some([least, most]) => {
                if !distribution.has_tails() {
                    let message = format!("`{}` already has bounds", self.distribution);
                    return Err(least.problem(WITHIN, message).help("remove `within`"));
                }
                let bounds = [number(least)?, number(most)?];
                distribution.quantile_within(p, bounds).filter(|_| bounds[0] < bounds[1]).ok_or_else(|| {
                    let message = format!("no value of `{}` lies between these bounds", self.distribution);
                    least
                        .problem(WITHIN, message)
                        .help("write the lower bound first, and choose bounds that contain some of the values")
                })?
            }
        };
        Ok(dimension.map_or_else(|| ExpressionValue::bare(si), |dimension| ExpressionValue::new(si, dimension)))
    }
}
