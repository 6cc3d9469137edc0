//! Live studies: structures are read and reduced once, and searches stop at once.

use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use stickslip_study::run::{Context, check, run};
use stickslip_study::{StructureCache, StructureCacheSettings, Study, read_study, read_study_with};

/// Writes a chain of 150 masses between two walls as matrices, and returns a study of it.
fn chain(folder: &Path, stiffness: f64) -> String {
    let rows = 150;
    let head = |entries: usize| format!("%%MatrixMarket matrix coordinate real symmetric\n{rows} {rows} {entries}\n");
    let (mut k, mut m) = (head(2 * rows - 1), head(rows));
    for row in 1..=rows {
        writeln!(m, "{row} {row} 0.01").unwrap();
        writeln!(k, "{row} {row} {}", 2.0 * stiffness).unwrap();
        if row > 1 {
            writeln!(k, "{row} {} {}", row - 1, -stiffness).unwrap();
        }
    }
    std::fs::write(folder.join("k.mtx"), k).unwrap();
    std::fs::write(folder.join("m.mtx"), m).unwrap();
    "schema = 1\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\nmodal_damping = 0.01\n\
     [[place]]\nname = \"middle\"\ndof = \"75\"\n[[joint]]\nname = \"pad\"\nbetween = [\"middle\", \"ground\"]\n\
     law = { kind = \"jenkins\", stiffness = \"1e4 N/m\", limit = \"2 N\" }\n[[force]]\non = \"middle\"\namplitude = \"1 N\"\n\
     [study]\nkind = \"response\"\nfrequency = { from = \"10 Hz\", to = \"20 Hz\", points = 5 }\n[method]\n\
     kind = \"harmonic-balance\"\nharmonics = 5\n"
        .to_owned()
}

fn stored(study: &Study) -> usize {
    study.case(0).unwrap().model.substructure.unwrap().component.stored_reductions()
}

#[test]
fn a_changed_joint_reduces_no_matrices_again() {
    let folder = tempfile::tempdir().unwrap();
    let text = chain(folder.path(), 1e6);
    let file = folder.path().join("chain.toml").display().to_string();
    let kept =
        Arc::new(StructureCache::new(StructureCacheSettings { reductions: 8, ..StructureCacheSettings::default() }));
    let live = |text: &str| read_study_with(&file, text, &kept).unwrap();
    let first = live(&text);
    let tables = run(&first, &Context::without_progress(1)).unwrap().tables;
    let once = stored(&first);
    assert!(once > 0 && kept.len() == 1);
    for limit in ["1 N", "3 N", "4 N"] {
        let study = live(&text.replace("limit = \"2 N\"", &format!("limit = \"{limit}\"")));
        run(&study, &Context::without_progress(1)).unwrap();
        assert_eq!(stored(&study), once, "{limit}");
    }
    // the numbers are those of a study that is read alone, bit for bit
    let alone = run(&read_study(&file, &text, &[]).unwrap(), &Context::without_progress(1)).unwrap().tables;
    assert_eq!(format!("{:?}", alone), format!("{:?}", tables));
    // other frequencies need other reductions; their number is bounded
    let most = (21..60).map(|end| {
        let study = live(&text.replace("20 Hz", &format!("{end} Hz")));
        check(&study).unwrap();
        stored(&study)
    });
    assert!(most.max().unwrap() <= 8 + once);
    assert_eq!(kept.len(), 1);
    // a file that changes on the disk is read again
    chain(folder.path(), 4e6);
    std::fs::File::options()
        .append(true)
        .open(folder.path().join("k.mtx"))
        .unwrap()
        .set_modified(std::time::SystemTime::UNIX_EPOCH)
        .unwrap();
    let stiffer = run(&live(&text), &Context::without_progress(1)).unwrap().tables;
    let amplitude = |tables: &[stickslip_study::dataset::Table]| tables[0].numbers("middle_amplitude_m").unwrap()[0];
    assert!(amplitude(&stiffer) < 0.9 * amplitude(&tables));
    // only the last structures stay
    for name in ["a", "b", "c"] {
        let other = folder.path().join(name);
        std::fs::create_dir(&other).unwrap();
        chain(&other, 1e6);
        read_study_with(&other.join("chain.toml").display().to_string(), &text, &kept).unwrap();
    }
    assert_eq!(kept.len(), 2);
}

/// A stop during a map or a performance curve ends after the current orbits, not after the
/// current peak.
#[test]
fn a_stopped_search_computes_no_more_grid_points() {
    let model = stickslip_study::templates::find("blade-couple").unwrap().study;
    let (model, _) = model.split_once("[study]").unwrap();
    let frequency = "frequency = { from = \"119.5 Hz\", to = \"122.5 Hz\", points = 500 }";
    let map = "kind = \"map\"\nover = { Ft = { from = \"2 N\", to = \"8 N\", points = 3 }, kt = { from = \"8 N/mm\", to = \"12 N/mm\", points = 3 } }";
    let curve = "kind = \"performance\"\nvary = { Ft = [\"2 N\", \"6 N\", \"8 N\"] }";
    for kind in [map, curve] {
        let study = read_study("couple.toml", &format!("{model}[study]\n{kind}\n{frequency}\n"), &[]).unwrap();
        let (stop, count) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
        let (after, counted) = (stop.clone(), count.clone());
        let finished = Arc::new(move || {
            counted.fetch_add(1, Ordering::Relaxed);
            after.store(true, Ordering::Relaxed);
        });
        let dataset = run(&study, &Context { threads: 2, stop, finished }).unwrap();
        assert!(dataset.record.interrupted, "{kind}");
        // each thread may be in an orbit
        let most = 2 * std::thread::available_parallelism().map_or(1, usize::from);
        assert!((1..=most).contains(&count.load(Ordering::Relaxed)), "{kind}: {count:?}");
        // the whole study counts every grid point once
        let count = Arc::new(AtomicUsize::new(0));
        let counted = count.clone();
        let finished = Arc::new(move || _ = counted.fetch_add(1, Ordering::Relaxed));
        let small =
            read_study("couple.toml", &format!("{model}[study]\n{kind}\n{frequency}\n").replace("500", "31"), &[])
                .unwrap();
        run(&small, &Context { threads: 2, stop: Arc::default(), finished }).unwrap();
        assert_eq!(count.load(Ordering::Relaxed), small.points(), "{kind}");
    }
}
