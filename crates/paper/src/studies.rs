//! The study files of the paper's figures, and their results.

use crate::measure::{Curve, Loop, curves, loops};
use std::collections::BTreeMap;
use stickslip::model::Model;
use stickslip_study::dataset::Dataset;
use stickslip_study::{Study, StudyError, read_study};

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../studies/paper/", $name, ".toml")))),*]
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

/// Name and text of the studies of the peak over the slip limit, for the models of three
/// figures.
pub const OPTIMA: &[(&str, &str)] = files!["fig06_optimum", "fig07_optimum", "fig10_optimum"];

/// Number of points of the response curves in the files.
const POINTS: &str = "points = 241";
/// Number of points in [`OPTIMA`]: a third is enough to find the peak before its refinement.
const COARSE_POINTS: &str = "points = 81";

/// Reads an embedded study.
///
/// `points` replaces the number of points of its response curves, `set` its parameters.
pub fn read(name: &str, points: Option<usize>, set: &[(&str, &str)]) -> Result<Study, StudyError> {
    let text = FILES.iter().chain(OPTIMA).find(|file| file.0 == name).map_or("", |file| file.1);
    let text = points.map_or(text.to_owned(), |points| {
        // Ratio of the two numbers of points.
        let coarse = format!("points = {}", points / 3 + 1);
        text.replace(POINTS, &format!("points = {points}")).replace(COARSE_POINTS, &coarse)
    });
    let set: Vec<(String, String)> = set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    read_study(&format!("{name}.toml"), &text, &set)
}

/// Results by name. Incomplete datasets of an interrupted run are on disk but not measured.
#[derive(Debug, Default)]
pub struct Results {
    runs: BTreeMap<String, (Study, Dataset)>,
}

impl Results {
    /// Adds a study and its dataset.
    pub fn insert(&mut self, study: Study, dataset: Dataset) {
        self.runs.insert(dataset.name.clone(), (study, dataset));
    }

    fn complete(&self, name: &str) -> Option<&(Study, Dataset)> {
        self.runs.get(name).filter(|(_, dataset)| !dataset.record.interrupted)
    }

    /// Returns a complete dataset.
    pub fn get(&self, name: &str) -> Option<&Dataset> {
        self.complete(name).map(|(_, dataset)| dataset)
    }

    /// Returns the model of the first case of a study whose dataset is complete.
    pub fn model(&self, name: &str) -> Option<Model> {
        Some(self.complete(name)?.0.case(0).ok()?.model)
    }

    /// Iterates over the datasets in the order of [`FILES`].
    pub fn all(&self) -> impl Iterator<Item = &Dataset> {
        FILES.iter().filter_map(|(name, _)| self.runs.get(*name)).map(|(_, dataset)| dataset)
    }

    /// Returns the response curves of a study, one per slip limit.
    pub fn curves(&self, name: &str) -> Option<Vec<Curve>> {
        let (study, dataset) = self.complete(name)?;
        curves(study, dataset)
    }

    /// Returns the loops of several studies in sequence.
    pub fn loops(&self, names: &[&str]) -> Option<Vec<Loop>> {
        let mut all = Vec::new();
        for name in names {
            let (study, dataset) = self.complete(name)?;
            all.extend(loops(study, dataset)?);
        }
        Some(all)
    }

    /// Returns the number of points without a result.
    pub fn failed(&self) -> u64 {
        self.runs.values().map(|(_, dataset)| dataset.failures.len() as u64).sum()
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
        let frequencies = |points| read("fig06_optimum", points, &[]).unwrap().case(0).unwrap().frequencies.unwrap();
        assert_eq!((frequencies(None).len(), frequencies(Some(25)).len()), (81, 9));
    }

    /// At equal slip limits, the optimum and its figure have equal models and frequency ranges.
    #[test]
    fn the_optima_are_of_the_models_of_their_figures() {
        for (name, _) in OPTIMA {
            let (figure, optimum) = (read(&name[..5], None, &[]).unwrap(), read(name, None, &[]).unwrap());
            assert_eq!((optimum.kind().name, optimum.varied()), ("performance", figure.varied()));
            let cases = |study: &Study| (0..study.cases()).map(|case| study.case(case).unwrap()).collect::<Vec<_>>();
            for of_figure in cases(&figure) {
                let of_optimum = cases(&optimum).into_iter().find(|case| case.varied == of_figure.varied).unwrap();
                assert_eq!(of_optimum.model, of_figure.model, "{name}, {}", of_figure.label());
                let ends = [of_figure, of_optimum].map(|case| {
                    let frequencies = case.frequencies.unwrap();
                    (frequencies.get(0), frequencies.get(frequencies.len() - 1))
                });
                assert_eq!(ends[0], ends[1], "{name}");
            }
        }
    }
}
