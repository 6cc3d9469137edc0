//! Proportional laws: two laws whose forces differ by a constant factor.
//!
//! If each parameter with the force dimension Nᵖ is multiplied by κᵖ, all forces are multiplied
//! by κ. The exponent p equals the kilogram exponent of the parameter's dimension.

use crate::law::Law;

impl dyn Law + '_ {
    /// Returns the factor between the forces of this law and those of `other`, equal in every
    /// motion. `None` if the laws are not proportional.
    pub(crate) fn force_ratio(&self, other: &dyn Law) -> Option<f64> {
        if !std::ptr::eq(self.info(), other.info()) {
            return None;
        }
        let mut times = None;
        for ((parameter, own), its) in self.info().parameters.iter().zip(self.values()).zip(other.values()) {
            let power = match parameter.dimension_for(|key| other.value(key)) {
                Some(dimension) if own != 0.0 || its != 0.0 => dimension.kg,
                _ => 0,
            };
            if power == 0 {
                if own != its {
                    return None;
                }
                continue;
            }
            let factor = (own / its).powf(1.0 / f64::from(power));
            let expected = *times.get_or_insert(factor);
            // Tolerance between the factors of different parameters: the rounding of a few
            // products and a root.
            if !(factor > 0.0 && factor.is_finite()) || (factor - expected).abs() > (8.0 * f64::EPSILON) * expected {
                return None;
            }
        }
        Some(times.unwrap_or(1.0))
    }
}

#[cfg(test)]
mod tests {
    use crate::law::{Coulomb2d, CoulombArctan, JenkinsArctan, Law, Stribeck, TABLE};

    fn times(one: &dyn Law, other: &dyn Law) -> Option<f64> {
        one.force_ratio(other)
    }

    #[test]
    fn force_parameters_scale_together() {
        let near =
            |found: Option<f64>, expected: f64| assert!((found.unwrap() / expected - 1.0).abs() < 1e-15, "{found:?}");
        near(times(&Coulomb2d { limit: 1e-9 }, &Coulomb2d { limit: 3.0 }), 1e-9 / 3.0);
        let smooth = |limit, alpha| CoulombArctan { limit, alpha };
        near(times(&smooth(0.3, 50.0), &smooth(0.1, 50.0)), 3.0);
        assert_eq!(times(&smooth(0.3, 50.0), &smooth(0.1, 51.0)), None);
        let elastic = |stiffness, limit| JenkinsArctan { stiffness, limit, alpha: 50.0 };
        near(times(&elastic(700.0, 0.7), &elastic(100.0, 0.1)), 7.0);
        assert_eq!(times(&elastic(700.0, 0.7), &elastic(100.0, 0.2)), None);
        let falling = |limit, static_limit| Stribeck { limit, static_limit, velocity: 0.1 };
        near(times(&falling(0.21, 0.3), &falling(0.7, 1.0)), 0.3);
        assert_eq!(times(&falling(0.0, 0.3), &falling(0.7, 1.0)), None);
        near(times(&falling(0.0, 0.3), &falling(0.0, 1.0)), 0.3);
        assert_eq!(times(&Coulomb2d { limit: 1.0 }, &smooth(1.0, 1.0)), None);
    }

    /// Each law has the factor 1 to itself.
    #[test]
    fn every_law_has_ratio_one_to_itself() {
        for row in TABLE {
            assert_eq!(times(&*row.sample(), &*row.sample()), Some(1.0), "{}", row.name);
        }
    }
}
