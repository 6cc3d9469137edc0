//! Damaged files of every format: no panic, no long search, and memory bounded by the file.

use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use peak_alloc::PeakAlloc;
use stickslip_formats::{Matrix, Report, Symmetry, TABLE, list_bytes, names, read_bytes, write};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Peaks of memory are those of the whole process: one test at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// Bytes that reading may take beyond a multiple of the file: a damaged size may state a million rows without entries, for each of
/// which the matrix and its report keep some numbers.
const ALWAYS: usize = 64 << 20;

/// Bytes of memory for every byte of a damaged file.
const TIMES: usize = 100;

/// Time for one damaged file of some kilobytes; a run takes milliseconds, the rest is what other programs take.
const PATIENCE: Duration = Duration::from_secs(5);

/// Random numbers that are the same in every run (Marsaglia's xorshift).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }

    fn pick<'a>(&mut self, from: &[&'a [u8]]) -> &'a [u8] {
        from[self.below(from.len())]
    }
}

/// What replaces a number in a text.
const WORDS: [&[u8]; 14] = [
    b"0",
    b"-1",
    b"1",
    b"2",
    b"999999999",
    b"4294967296",
    b"18446744073709551615",
    b"9223372036854775807",
    b"nan",
    b"inf",
    b"1e999",
    b"1.0-5",
    b"",
    b"x",
];

/// What replaces a whole number in binary.
const NUMBERS: [u64; 10] =
    [0, 1, 2, 0x7f, 0x7fff_ffff, 0xffff_ffff, 0x8000_0000, 0x7fff_ffff_ffff_ffff, u64::MAX, 0x1_0000];

/// One damage.
fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    let at = random.below(bytes.len());
    let Some(&byte) = bytes.get(at) else { return };
    match random.below(8) {
        0 => bytes[at] = random.next() as u8,
        1 => bytes[at] = byte ^ (1 << random.below(8)),
        2 => {
            // The word at this place becomes another one.
            let inside = |byte: &u8| byte.is_ascii_alphanumeric() || b"+-.".contains(byte);
            let start = bytes[..at].iter().rposition(|byte| !inside(byte)).map_or(0, |before| before + 1);
            let end = bytes[at..].iter().position(|byte| !inside(byte)).map_or(bytes.len(), |length| at + length);
            bytes.splice(start..end.max(start), random.pick(&WORDS).iter().copied());
        }
        3 | 4 => {
            let value = NUMBERS[random.below(NUMBERS.len())];
            let order = if random.below(2) == 0 { value.to_le_bytes() } else { value.to_be_bytes() };
            // Most whole numbers in files are aligned.
            let at = at & !3;
            let end = bytes.len().min(at + [4, 8][random.below(2)]);
            let length = end - at;
            bytes[at..end].copy_from_slice(&order[..length]);
        }
        5 => bytes.truncate(at),
        6 => {
            let end = bytes.len().min(at + random.below(64));
            bytes.drain(at..end);
        }
        _ => {
            let end = bytes.len().min(at + random.below(64));
            let copy = bytes[at..end].to_vec();
            let to = random.below(bytes.len());
            bytes.splice(to..to, copy);
        }
    }
}

/// Reads all that is in a file, and gives the number of its matrices.
fn read_all(bytes: &[u8], format: &str) -> usize {
    let Ok(variables) = list_bytes(bytes, Some(format)) else { return 0 };
    let found = variables.iter().take(20).filter_map(|variable| {
        let name = Some(variable.name.as_str()).filter(|name| !name.is_empty());
        let matrix = read_bytes(bytes, Some(format), name).ok()?;
        assert!(matrix.entries().iter().all(|e| e.value.is_finite() && e.value != 0.0));
        assert!(matrix.entries().is_sorted_by(|a, b| (a.column, a.row) < (b.column, b.row)));
        Some(Report::new(&matrix).to_string().len())
    });
    found.count()
}

/// Damages the files of one format, `count` times each or until `end`.
fn fuzz(format: &str, seed: u64, count: usize, end: Instant) -> (usize, usize) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let mut paths: Vec<_> =
        std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    let files = paths.iter().map(|path| std::fs::read(path).expect("a file"));
    let files: Vec<_> = files.filter(|bytes| read_all(bytes, format) > 0).collect();
    assert!(!files.is_empty(), "no file of {format}");
    let mut random = Random(seed);
    let (mut runs, mut matrices) = (0, 0);
    for _ in 0..count {
        for file in &files {
            let mut bytes = file.clone();
            for _ in 0..1 + random.below(4) {
                damage(&mut bytes, &mut random);
            }
            MEMORY.reset_peak_usage();
            let (before, start) = (MEMORY.current_usage(), Instant::now());
            matrices += read_all(&bytes, format);
            let (memory, time) = (MEMORY.peak_usage().saturating_sub(before), start.elapsed());
            runs += 1;
            let path = std::env::temp_dir().join(format!("stickslip-damaged-{format}"));
            if memory > ALWAYS + TIMES * bytes.len() || time > PATIENCE {
                std::fs::write(&path, &bytes).expect("a file");
                panic!("{memory} bytes and {time:?} for {} bytes, kept as {}", bytes.len(), path.display());
            }
        }
        if Instant::now() > end {
            break;
        }
    }
    (runs, matrices)
}

#[test]
fn damaged_files_of_every_format() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    for format in TABLE {
        let end = Instant::now() + Duration::from_secs(60);
        let (runs, matrices) = fuzz(format.name, 0x9e37_79b9_7f4a_7c15, 400, end);
        // Most damages are in numbers, which stay numbers: a reader that refused all would not be tested.
        assert!(matrices > 0 && runs >= 400, "{}: {matrices} matrices in {runs} runs", format.name);
    }
}

/// Ten minutes for every format: `cargo test -p stickslip-formats --test fuzz -- --ignored --nocapture`.
///
/// `STICKSLIP_FUZZ_SECONDS` and `STICKSLIP_FUZZ_SEED` set another time and another start, `STICKSLIP_FUZZ_FORMAT` one format.
#[test]
#[ignore = "ten minutes for every format"]
fn damaged_files_of_every_format_for_ten_minutes() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let number = |name: &str, default| std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (seconds, seed) = (number("STICKSLIP_FUZZ_SECONDS", 600), number("STICKSLIP_FUZZ_SEED", 0x1234_5678_9abc_def1));
    let only = std::env::var("STICKSLIP_FUZZ_FORMAT").ok();
    for format in TABLE.iter().filter(|format| only.as_ref().is_none_or(|only| only == format.name)) {
        let end = Instant::now() + Duration::from_secs(seconds);
        let (runs, matrices) = fuzz(format.name, seed.max(1), usize::MAX, end);
        eprintln!("{}: {runs} damaged files, {matrices} matrices in them", format.name);
    }
}

#[test]
fn damaged_names_of_rows() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut random = Random(77);
    for good in [
        &b"row,name\n1,a\n2,\"b,c\"\n3,d\n"[..],
        b"10.1\n10.2\n7.3\n",
        b" Matrix Eqn Node DOF\n1 7 UX\n3 7 UZ\n2 7 UY\n",
    ] {
        assert!(names::read_bytes(good, 3).is_ok());
        for _ in 0..5000 {
            let mut bytes = good.to_vec();
            damage(&mut bytes, &mut random);
            if let Ok(names) = names::read_bytes(&bytes, 3) {
                assert_eq!(names.len(), 3);
            }
        }
    }
}

/// A million entries of a chain of masses: memory is at most ten times the file, whatever the format.
#[test]
fn memory_follows_the_file() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let size = 100_000;
    let chain = (0..size).flat_map(|i| [(i, i, 2.0 + 1e-3 * i as f64), (i.min(size - 2) + 1, i.min(size - 2), -1.0)]);
    let matrix = Matrix::new(size, size, Symmetry::Symmetric, chain).expect("a matrix");
    let folder = tempfile::tempdir().expect("a folder");
    let check = |name: &str, bytes: &[u8]| {
        MEMORY.reset_peak_usage();
        let before = MEMORY.current_usage();
        let entries = read_bytes(bytes, None, None).expect(name).entries().len();
        let memory = MEMORY.peak_usage().saturating_sub(before);
        assert_eq!(entries, matrix.entries().len(), "{name}");
        assert!(memory <= 10 * bytes.len(), "{name}: {memory} bytes of memory for {} bytes", bytes.len());
    };
    for ending in ["mtx", "npz"] {
        let path = folder.path().join(format!("chain.{ending}"));
        write(&path, &matrix).expect("a file");
        check(ending, &std::fs::read(&path).expect("a file"));
    }
    let (full_size, mut full) = (1000_usize, b"\x93NUMPY\x01\x00\x76\x00".to_vec());
    full.extend(format!("{:117}\n", "{'descr': '|u1', 'fortran_order': False, 'shape': (1000, 1000), }").into_bytes());
    full.extend((0..full_size * full_size).map(|at| if at % 7 < 3 { 1 } else { 0 }));
    MEMORY.reset_peak_usage();
    let before = MEMORY.current_usage();
    assert!(read_bytes(&full, None, None).is_ok_and(|matrix| matrix.entries().len() > 400_000));
    let memory = MEMORY.peak_usage().saturating_sub(before);
    // A matrix that is not sparse, of numbers of one byte, is the worst case: 16 bytes for each.
    assert!(memory <= 8 * full.len(), "{memory} bytes of memory for {} bytes", full.len());
    let lines = |line: &dyn Fn(u32, u32, f64) -> String| -> Vec<u8> {
        matrix.entries().iter().flat_map(|e| line(e.row + 1, e.column + 1, e.value).into_bytes()).collect()
    };
    check("coordinate", &lines(&|row, column, value| format!("{row} {column} {value}\n")));
    check("abaqus-matrix-input", &lines(&|row, column, value| format!("{row},1, {column},1, {value:.15e}\n")));
    let mut cards = b"DMIG    K              0       6       2\n".to_vec();
    cards.extend(lines(&|row, column, value| {
        format!("DMIG*   {:16}{column:16}{:16}{:16}\n*       {row:16}{:16}{value:16.9e}\n", "K", 1, "", 1)
    }));
    check("nastran-dmig", &cards);
}
