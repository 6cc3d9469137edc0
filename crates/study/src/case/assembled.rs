//! The system of the model that was assembled last.
//!
//! Check, survey, computation and figure of a study assemble the same case one after the other.
//! For a disk of matrices one assembly takes a second and 100 MB.

use std::sync::{Arc, Mutex, PoisonError};
use stickslip::model::{Model, ModelError, System};

/// Keeps the last model with its system. Copies share it.
#[derive(Debug, Clone, Default)]
pub(crate) struct LastAssembled(Arc<Mutex<Option<Arc<Assembled>>>>);

/// A model with its system.
#[derive(Debug)]
struct Assembled {
    model: Model,
    system: System,
}

impl LastAssembled {
    /// Returns the system of a model, which is assembled unless it was the last one.
    pub(crate) fn system(&self, model: &Model) -> Result<System, ModelError> {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(last) = last.filter(|last| last.model == *model) {
            return Ok(last.system.clone());
        }
        let system = model.assemble()?;
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Arc::new(Assembled { model: model.clone(), system: system.clone() }));
        Ok(system)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip::model::example;

    /// A changed model is assembled again, and the first one after it too.
    #[test]
    fn systems_belong_to_their_models() {
        let last = LastAssembled::default();
        let mut other = example::blade_couple();
        other.masses[0].mass *= 2.0;
        for model in [example::blade_couple(), other, example::blade_couple()] {
            for _ in 0..2 {
                let [system, own] = [last.system(&model), model.assemble()].map(Result::unwrap);
                assert_eq!((system.places(), system.structure()), (own.places(), own.structure()));
            }
        }
        let mut wrong = example::blade_couple();
        wrong.masses[0].mass = -1.0;
        assert_eq!(last.system(&wrong).unwrap_err(), wrong.assemble().unwrap_err());
    }
}
