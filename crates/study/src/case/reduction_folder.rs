//! The folder in which a study keeps its reductions, one file for each.

use std::path::{Path, PathBuf};
use stickslip::structure::ReductionStore;

/// A folder of reductions.
///
/// A file that is damaged, or cannot be written, counts as missing: the reduction is computed.
#[derive(Debug)]
pub(crate) struct ReductionFolder(PathBuf);

impl ReductionFolder {
    /// Creates the folder if it does not exist.
    ///
    /// # Errors
    /// The folder cannot be created.
    pub fn create(path: PathBuf) -> std::io::Result<Self> {
        std::fs::create_dir_all(&path)?;
        Ok(ReductionFolder(path))
    }

    fn file(&self, key: &str) -> PathBuf {
        self.0.join(format!("{key}.reduction"))
    }
}

impl ReductionStore for ReductionFolder {
    fn load(&self, key: &str) -> Option<Vec<u8>> {
        let bytes = std::fs::read(self.file(key)).ok()?;
        let (checksum, content) = bytes.split_first_chunk()?;
        (crc32fast::hash(content) == u32::from_le_bytes(*checksum)).then(|| content.to_vec())
    }

    fn save(&self, key: &str, bytes: &[u8]) {
        let bytes = [&crc32fast::hash(bytes).to_le_bytes()[..], bytes].concat();
        let file = self.file(key);
        // another run may read the folder: a file appears when it is complete
        let part = file.with_extension(format!("{}.part", std::process::id()));
        if write_and_rename(&part, &file, &bytes).is_err() {
            let _ = std::fs::remove_file(&part);
        }
    }
}

fn write_and_rename(part: &Path, file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    std::fs::write(part, bytes)?;
    std::fs::rename(part, file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use stickslip::structure::{Boundary, Component, Reduction};
    use stickslip_numerics::sparse::SparseMatrix;

    /// A chain of masses on springs to the ground, whose first mass is coupled to the second.
    fn chain(stiffness: f64) -> Component {
        let n = 40;
        let springs = (0..n - 1).flat_map(|i| [(i, i + 1, -stiffness), (i + 1, i, -stiffness)]);
        let stiffness = SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 3.0 * stiffness)).chain(springs)).unwrap();
        let mass = SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 0.1))).unwrap();
        Component::new((0..n).map(|i| format!("{i}.x")).collect(), mass, None, stiffness).unwrap()
    }

    /// The reductions of a chain, alone and as one of nine sectors, and the shapes of the first,
    /// kept in a folder.
    fn reduced(stiffness: f64, folder: &Path) -> [String; 3] {
        let chain = chain(stiffness);
        chain.keep_reductions(Arc::new(ReductionFolder::create(folder.to_owned()).unwrap()));
        let (seen, how) = ([vec![(20, 1.0)]], Reduction::up_to(15.0));
        let sides = [("0".to_owned(), "39".to_owned())];
        let boundary = Boundary::of_nodes(chain.rows(), &sides, None).unwrap();
        let alone = format!("{:?}", chain.reduced(&seen, &how).unwrap());
        let sector = chain.reduced_sector(&boundary, 9, &seen, &how).unwrap();
        let [mass, stiffness] = [sector.component.matrices().0, sector.component.matrices().2];
        let shapes = format!("{:?}", chain.shapes(&seen, &how).unwrap());
        [alone, format!("{:?} {:?} {:?}", mass, stiffness, sector.error), shapes]
    }

    fn files(folder: &Path) -> Vec<PathBuf> {
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()).collect();
        files.sort();
        files
    }

    /// A kept reduction has the bits of the computed one. A changed stiffness finds no kept
    /// reduction, and a damaged file is replaced.
    #[test]
    fn a_kept_reduction_equals_the_computed_one() {
        let folder = tempfile::tempdir().unwrap();
        let computed = reduced(1.0, folder.path());
        let kept = files(folder.path());
        assert_eq!(kept.len(), 3);
        let modified = |file: &PathBuf| std::fs::metadata(file).unwrap().modified().unwrap();
        let times: Vec<_> = kept.iter().map(modified).collect();
        assert_eq!(reduced(1.0, folder.path()), computed);
        assert_eq!((files(folder.path()), kept.iter().map(modified).collect::<Vec<_>>()), (kept.clone(), times));
        // the file is damaged, not the result
        let content = std::fs::read(&kept[0]).unwrap();
        let damaged: Vec<u8> = content.iter().enumerate().map(|(i, byte)| byte ^ u8::from(i == 99)).collect();
        for bytes in [damaged, content[..content.len() / 2].to_vec(), Vec::new()] {
            std::fs::write(&kept[0], bytes).unwrap();
            assert_eq!(reduced(1.0, folder.path()), computed);
            assert_eq!(std::fs::read(&kept[0]).unwrap(), content);
        }
        assert_ne!(reduced(1.1, folder.path()), computed);
        assert_eq!(files(folder.path()).len(), 6);
    }
}
