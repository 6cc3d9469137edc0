//! Consistent unit sets of finite-element programs: their units of length, mass, time, stiffness
//! and damping in SI.

/// A consistent set of units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitSet {
    /// Its name in study files: length, mass, time.
    pub name: &'static str,
    /// One line that describes it.
    pub summary: &'static str,
    /// Its unit of length, m.
    pub length: f64,
    /// Its unit of mass, kg.
    pub mass: f64,
    /// Its unit of time, s.
    pub time: f64,
}

impl UnitSet {
    /// Returns its unit of stiffness, mass per time squared, N/m.
    pub fn stiffness(&self) -> f64 {
        self.mass / (self.time * self.time)
    }

    /// Returns its unit of damping, mass per time, kg/s.
    pub fn damping(&self) -> f64 {
        self.mass / self.time
    }
}

/// The pound-force, N: exact by definition, 0.45359237 kg times 9.80665 m/s².
const POUND: f64 = 4.4482216152605;
/// The inch, m.
const INCH: f64 = 0.0254;
/// The foot, m.
const FOOT: f64 = 0.3048;

/// All unit sets.
pub const TABLE: &[UnitSet] = &[
    UnitSet {
        name: "m-kg-s",
        summary: "SI: metre, kilogram, second, newton, pascal",
        length: 1.0,
        mass: 1.0,
        time: 1.0,
    },
    UnitSet {
        name: "mm-t-s",
        summary: "millimetre, tonne, second, newton, megapascal; densities like 7.85e-9",
        length: 1e-3,
        mass: 1e3,
        time: 1.0,
    },
    UnitSet {
        name: "mm-kg-s",
        summary: "millimetre, kilogram, second, millinewton, kilopascal; densities like 7.85e-6, moduli like 2.1e8",
        length: 1e-3,
        mass: 1.0,
        time: 1.0,
    },
    UnitSet {
        name: "mm-kg-ms",
        summary: "millimetre, kilogram, millisecond, kilonewton, gigapascal; densities like 7.85e-6, moduli like 210",
        length: 1e-3,
        mass: 1.0,
        time: 1e-3,
    },
    UnitSet {
        name: "mm-g-ms",
        summary: "millimetre, gram, millisecond, newton, megapascal; densities like 7.85e-3",
        length: 1e-3,
        mass: 1e-3,
        time: 1e-3,
    },
    UnitSet { name: "cm-g-s", summary: "centimetre, gram, second, dyne", length: 1e-2, mass: 1e-3, time: 1.0 },
    UnitSet {
        name: "in-lbf-s",
        summary: "inch, pound of force, second, mass in lbf s²/in (snail); densities like 7.3e-4",
        length: INCH,
        mass: POUND / INCH,
        time: 1.0,
    },
    UnitSet {
        name: "ft-lbf-s",
        summary: "foot, pound of force, second, mass in slugs; densities like 15.2",
        length: FOOT,
        mass: POUND / FOOT,
        time: 1.0,
    },
];

/// Returns the unit set with this name.
pub fn find(name: &str) -> Option<&'static UnitSet> {
    TABLE.iter().find(|set| set.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One unit of force is one unit of stiffness times one unit of length.
    #[test]
    fn units_of_force() {
        for (name, length, force) in [
            ("m-kg-s", 1.0, 1.0),
            ("mm-t-s", 1e-3, 1.0),
            ("mm-kg-s", 1e-3, 1e-3),
            ("mm-kg-ms", 1e-3, 1e3),
            ("mm-g-ms", 1e-3, 1.0),
            ("cm-g-s", 1e-2, 1e-5),
            ("in-lbf-s", 0.0254, 4.4482216152605),
            ("ft-lbf-s", 0.3048, 4.4482216152605),
        ] {
            assert_eq!(find(name).unwrap().length, length, "{name}");
            let stiffness = find(name).unwrap().stiffness();
            assert!((stiffness * length / force - 1.0).abs() < 1e-15, "{name}");
        }
        assert_eq!(TABLE.len(), 8);
        // a slug is 32.174 pounds
        assert!((find("ft-lbf-s").unwrap().mass / 0.45359237 - 32.174).abs() < 1e-3);
    }
}
