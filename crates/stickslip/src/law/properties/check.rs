//! Checks of a law: parameter ranges, consistency, and the claims of its implementation.

use super::odd_symmetry;
use crate::dimension::Dimension;
use crate::law::{BuildError, Law, LawError, LawInfo, Parameter, SharedLaw};
use std::collections::BTreeMap;

impl LawInfo {
    /// Builds the law from values by key (SI).
    ///
    /// # Errors
    /// Parameters are missing, or a value is not finite or out of its range, or
    /// [`Law::check_consistency`] fails.
    ///
    /// # Example
    /// ```
    /// use std::collections::BTreeMap;
    /// let row = stickslip::law::find("coulomb").unwrap();
    /// let law = row.build(&BTreeMap::from([("limit", 2.0)])).unwrap();
    /// assert_eq!(law.values(), [2.0]);
    /// ```
    pub fn build(&self, values: &BTreeMap<&str, f64>) -> Result<SharedLaw, BuildError> {
        let value = |p: &Parameter| values.get(p.key).copied().or(p.default);
        let missing: Vec<&'static str> = self.parameters.iter().filter(|p| value(p).is_none()).map(|p| p.key).collect();
        if !missing.is_empty() {
            return Err(BuildError::Missing { law: self.name, keys: missing });
        }
        let ordered: Vec<f64> = self.parameters.iter().filter_map(value).collect();
        // The constructor accepts only values within their ranges.
        in_range(self, &ordered)?;
        let law = (self.build)(&ordered);
        law.check()?;
        Ok(law)
    }
}

impl dyn Law + '_ {
    /// Checks that every parameter is finite and in its range, and that the parameters are
    /// consistent. Also checks that the scale of internal states is positive and that an odd law
    /// is odd.
    ///
    /// # Errors
    /// [`LawError`] names the first parameter that is invalid, or describes the inconsistency.
    pub fn check(&self) -> Result<(), LawError> {
        in_range(self.info(), &self.values())?;
        self.check_consistency().map_err(|message| LawError::Inconsistent { law: self.name(), message })?;
        // Errors of states are relative to this scale; zero would give NaN.
        let sizes = [
            self.step().filter(|step| step.states() > 0).map(|step| step.state_scale()),
            self.rate().filter(|rate| rate.states() > 0).map(|rate| rate.state_scale()),
        ];
        if let Some(size) = sizes.into_iter().flatten().find(|size| !(size.is_finite() && *size > 0.0)) {
            let message =
                format!("`state_scale` is {size}; the scale of the internal states must be finite and positive");
            return Err(LawError::Inconsistent { law: self.name(), message });
        }
        if self.is_odd() && odd_symmetry::violates_odd_symmetry(self) {
            let message = "`is_odd` returns true, but a mirrored motion does not give the mirrored force; `is_odd` \
                           must return false";
            return Err(LawError::Inconsistent { law: self.name(), message: message.to_owned() });
        }
        Ok(())
    }
}

/// Checks that every value is in its range.
fn in_range(info: &LawInfo, values: &[f64]) -> Result<(), LawError> {
    for (parameter, &value) in info.parameters.iter().zip(values) {
        if !parameter.range.contains(value) {
            let Parameter { key, range, .. } = *parameter;
            let of = |key: &str| Some(values[info.parameters.iter().position(|p| p.key == key)?]);
            let dimension = parameter.dimension_for(of).unwrap_or(Dimension::NONE);
            return Err(LawError::Value { law: info.name, key, dimension, range, value });
        }
    }
    Ok(())
}
