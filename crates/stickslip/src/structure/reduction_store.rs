//! Reductions that are kept between runs.
//!
//! A reduction follows from the matrices, the observed rows and the request. Its key is a hash of
//! all of them and of the version of this crate, so that a changed input never finds an older
//! result.

use super::reduction::ReductionError;
use serde::Serialize;
use serde::de::DeserializeOwned;
use siphasher::sip128::{Hasher128, SipHasher13};
use std::fmt::{Debug, Formatter};
use std::hash::Hash;
use std::sync::Arc;
use stickslip_numerics::sparse::SparseMatrix;

/// Keeps reductions between runs, for example in a folder.
pub trait ReductionStore: Send + Sync {
    /// Returns what is kept under a key, which is a hexadecimal number.
    fn load(&self, key: &str) -> Option<Vec<u8>>;
    /// Keeps bytes under a key.
    fn save(&self, key: &str, bytes: &[u8]);
}

/// A store, with the hash of what all reductions of a component depend on.
#[derive(Clone)]
pub(super) struct KeptReductions {
    store: Arc<dyn ReductionStore>,
    inputs: SipHasher13,
}

impl KeptReductions {
    /// Keeps the reductions of a component with these matrices of mass, damping and stiffness.
    pub fn new(
        store: Arc<dyn ReductionStore>,
        matrices: (&SparseMatrix, Option<&SparseMatrix>, &SparseMatrix),
    ) -> Self {
        let mut inputs = SipHasher13::new();
        env!("CARGO_PKG_VERSION").hash(&mut inputs);
        let (mass, damping, stiffness) = matrices;
        for matrix in [Some(mass), damping, Some(stiffness)] {
            matrix.map(SparseMatrix::n).hash(&mut inputs);
            for (row, column, value) in matrix.into_iter().flat_map(SparseMatrix::entries) {
                (row, column, value.to_bits()).hash(&mut inputs);
            }
        }
        KeptReductions { store, inputs }
    }

    /// Returns where they are kept.
    pub fn store(&self) -> Arc<dyn ReductionStore> {
        self.store.clone()
    }

    /// Keeps reductions that also depend on `input`, whose debug text names all its values.
    pub fn with_input(&self, input: &impl Debug) -> Self {
        let mut inputs = self.inputs;
        format!("{input:?}").hash(&mut inputs);
        KeptReductions { store: self.store.clone(), inputs }
    }

    /// Returns the kept result, or computes it and keeps it.
    pub fn load_or_compute<T: Serialize + DeserializeOwned>(
        &self,
        compute: impl FnOnce() -> Result<Arc<T>, ReductionError>,
    ) -> Result<Arc<T>, ReductionError> {
        let hash = self.inputs.finish128();
        let key = format!("{:016x}{:016x}", hash.h1, hash.h2);
        let kept = self.store.load(&key).and_then(|bytes| rmp_serde::from_slice(&bytes).ok());
        if let Some(kept) = kept {
            return Ok(Arc::new(kept));
        }
        let computed = compute()?;
        if let Ok(bytes) = rmp_serde::to_vec(&*computed) {
            self.store.save(&key, &bytes);
        }
        Ok(computed)
    }
}

impl Debug for KeptReductions {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("KeptReductions").finish_non_exhaustive()
    }
}
