//! The study files of the paper's figures, and what running them yields.

use super::measure::{Curve, Loop, curves, loops};
use std::collections::BTreeMap;
use stickslip_study::dataset::Dataset;
use stickslip_study::{Study, StudyError, read_study};

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../studies/paper/", $name, ".toml")))),*]
    };
}

/// Name and text of every study file, in the order in which they run.
pub const FILES: &[(&str, &str)] = files![
    "fig02",
    "fig03a",
    "fig03b",
    "fig04a",
    "fig04b",
    "fig04a_coulomb",
    "fig04b_coulomb",
    "fig06",
    "fig07",
    "fig08",
    "fig10",
    "fig06_arctan",
    "fig07_arctan",
    "fig08_arctan",
    "fig08_arctan_similar",
    "fig10_arctan",
];

/// Points of the response curves in the files.
const POINTS: &str = "points = 241";

/// Reads an embedded study; `points` replaces the number of points of its response curves, `set` its parameters.
pub fn read(name: &str, points: Option<usize>, set: &[(&str, &str)]) -> Result<Study, StudyError> {
    let text = FILES.iter().find(|file| file.0 == name).map_or("", |file| file.1);
    let text = points.map_or(text.to_owned(), |points| text.replace(POINTS, &format!("points = {points}")));
    let set: Vec<(String, String)> = set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    read_study(&format!("{name}.toml"), &text, &set)
}

/// What has been computed, by name. A dataset that an interruption cut short is kept on disk but not measured.
#[derive(Debug, Default)]
pub struct Results {
    datasets: BTreeMap<String, Dataset>,
}

impl Results {
    /// Adds a dataset.
    pub fn insert(&mut self, dataset: Dataset) {
        self.datasets.insert(dataset.name.clone(), dataset);
    }

    /// A dataset that is complete.
    pub fn get(&self, name: &str) -> Option<&Dataset> {
        self.datasets.get(name).filter(|dataset| !dataset.record.interrupted)
    }

    /// Every dataset, in the order of [`FILES`].
    pub fn all(&self) -> impl Iterator<Item = &Dataset> {
        FILES.iter().filter_map(|(name, _)| self.datasets.get(*name))
    }

    /// The response curves of a study, one per slip limit.
    pub fn curves(&self, name: &str) -> Option<Vec<Curve>> {
        curves(self.get(name)?)
    }

    /// The loops of several studies, one after the other.
    pub fn loops(&self, names: &[&str]) -> Option<Vec<Loop>> {
        let mut all = Vec::new();
        for name in names {
            all.extend(loops(self.get(name)?)?);
        }
        Some(all)
    }

    /// Points without a result.
    pub fn failed(&self) -> u64 {
        self.datasets.values().map(|dataset| dataset.failures.len() as u64).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_embedded_study_reads_and_has_a_title_and_a_source() {
        for (name, text) in FILES {
            let study = read(name, None, &[]).unwrap();
            assert_eq!(study.name(), *name);
            assert!(study.title().starts_with("Fig. ") && study.source().is_some(), "{name}");
            assert_eq!(text.contains(POINTS), study.kind().name == "response", "{name}");
        }
    }

    #[test]
    fn the_number_of_points_can_be_reduced() {
        assert_eq!(read("fig06", None, &[]).unwrap().points(), 4 * 241);
        assert_eq!(read("fig06", Some(25), &[("kt", "5000 N/m")]).unwrap().points(), 4 * 25);
    }
}
