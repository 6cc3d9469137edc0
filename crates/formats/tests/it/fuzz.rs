//! Damaged files of every format: no panic, and memory bounded by the file.

use std::path::Path;

use allocation_counter::measure;
use stickslip_formats::{Matrix, MatrixReport, Symmetry, TABLE, list_bytes, names, read_bytes, write};

/// Bytes of memory that reading may take beyond a multiple of the file.
///
/// A damaged size may state a million rows without entries. The matrix and its
/// report store some numbers for each row.
const BASE_MEMORY: u64 = 64 << 20;

/// Bytes of memory for every byte of a damaged file.
const MEMORY_PER_BYTE: u64 = 100;

/// Random numbers with the same sequence in every run (Marsaglia's xorshift).
pub(crate) struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }

    fn pick<'a>(&mut self, from: &[&'a [u8]]) -> &'a [u8] {
        from[self.below(from.len())]
    }
}

/// Replacements for a number in a text.
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

/// Replacements for an integer in binary data.
const NUMBERS: [u64; 10] =
    [0, 1, 2, 0x7f, 0x7fff_ffff, 0xffff_ffff, 0x8000_0000, 0x7fff_ffff_ffff_ffff, u64::MAX, 0x1_0000];

/// Applies one random damage.
fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    let at = random.below(bytes.len());
    let Some(&byte) = bytes.get(at) else { return };
    match random.below(8) {
        0 => bytes[at] = random.next() as u8,
        1 => bytes[at] = byte ^ (1 << random.below(8)),
        2 => {
            // Replaces the word at this position.
            let inside = |byte: &u8| byte.is_ascii_alphanumeric() || b"+-.".contains(byte);
            let start = bytes[..at].iter().rposition(|byte| !inside(byte)).map_or(0, |before| before + 1);
            let end = bytes[at..].iter().position(|byte| !inside(byte)).map_or(bytes.len(), |length| at + length);
            bytes.splice(start..end.max(start), random.pick(&WORDS).iter().copied());
        }
        3 | 4 => {
            let value = NUMBERS[random.below(NUMBERS.len())];
            let order = if random.below(2) == 0 { value.to_le_bytes() } else { value.to_be_bytes() };
            // Most integers in files are aligned.
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

/// Returns a copy of a file with one to four damages.
pub(crate) fn damaged(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..1 + random.below(4) {
        damage(&mut bytes, random);
    }
    bytes
}

/// Returns the number that an environment variable sets.
pub(crate) fn number_of_variable(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Reads all matrices of a file and returns their number.
fn read_all(bytes: &[u8], format: &str) -> usize {
    let Ok(variables) = list_bytes(bytes, Some(format)) else { return 0 };
    let found = variables.iter().take(20).filter_map(|variable| {
        let name = Some(variable.name.as_str()).filter(|name| !name.is_empty());
        let matrix = read_bytes(bytes, Some(format), name).ok()?;
        assert!(matrix.entries().iter().all(|e| e.value.is_finite() && e.value != 0.0));
        assert!(matrix.entries().is_sorted_by(|a, b| (a.column, a.row) < (b.column, b.row)));
        Some(MatrixReport::new(&matrix).to_string().len())
    });
    found.count()
}

/// Returns the largest memory that a function holds at one time, bytes. Allocations of other
/// threads do not count.
pub(crate) fn peak_memory(f: impl FnOnce()) -> u64 {
    measure(f).bytes_max
}

/// Damages the files of one format, `count` times each. Returns the numbers of
/// runs and of matrices read.
fn fuzz(format: &str, seed: u64, count: usize) -> (usize, usize) {
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
            let bytes = damaged(file, &mut random);
            let memory = peak_memory(|| matrices += read_all(&bytes, format));
            runs += 1;
            if memory > BASE_MEMORY + MEMORY_PER_BYTE * bytes.len() as u64 {
                let path = std::env::temp_dir().join(format!("stickslip-damaged-{format}"));
                std::fs::write(&path, &bytes).expect("a file");
                panic!("{memory} bytes of memory for {} bytes, kept as {}", bytes.len(), path.display());
            }
        }
    }
    (runs, matrices)
}

#[test]
fn damaged_files_of_every_format() {
    for format in TABLE {
        let (runs, matrices) = fuzz(format.name, 0x9e37_79b9_7f4a_7c15, 400);
        // Most damaged numbers are still numbers. A reader that refuses all
        // damaged files would not be tested.
        assert!(matrices > 0 && runs >= 400, "{}: {matrices} matrices in {runs} runs", format.name);
    }
}

/// Many damages: `cargo test -p stickslip-formats --test it fuzz -- --ignored --nocapture`.
///
/// `STICKSLIP_FUZZ_RUNS` and `STICKSLIP_FUZZ_SEED` set the damages of every file and the seed,
/// `STICKSLIP_FUZZ_FORMAT` selects one format.
#[test]
#[ignore = "takes minutes for every format"]
fn many_damaged_files_of_every_format() {
    let count = number_of_variable("STICKSLIP_FUZZ_RUNS", 50_000);
    let seed = number_of_variable("STICKSLIP_FUZZ_SEED", 0x1234_5678_9abc_def1);
    let only = std::env::var("STICKSLIP_FUZZ_FORMAT").ok();
    for format in TABLE.iter().filter(|format| only.as_ref().is_none_or(|only| only == format.name)) {
        let (runs, matrices) = fuzz(format.name, seed.max(1), count as usize);
        eprintln!("{}: {runs} damaged files, {matrices} matrices in them", format.name);
    }
}

#[test]
fn damaged_names_of_rows() {
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

/// Rows of a chain of masses, and of full matrices. They give at least a
/// million bytes in every format.
const CHAIN: usize = 100_000;
const FULL: usize = 1000;

/// Returns a large file of a format, by its documentation, in its most compact notation.
fn large(format: &str) -> Vec<u8> {
    // Row and column from 1, and value, of the lower triangle, column by column.
    let chain = || {
        let columns = 1..=CHAIN as u32;
        columns.flat_map(|i| [(i, i, 2.0 + 1e-3 * f64::from(i)), (i + 1, i, -1.0)]).take(2 * CHAIN - 1)
    };
    let lines = |line: &dyn Fn(u32, u32, f64) -> String| -> Vec<u8> {
        chain().flat_map(|(row, column, value)| line(row, column, value).into_bytes()).collect()
    };
    let written = |ending: &str| {
        let entries = chain().map(|(row, column, value)| (row as usize - 1, column as usize - 1, value));
        let matrix = Matrix::new(CHAIN, CHAIN, Symmetry::Symmetric, entries).expect("a matrix");
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(format!("chain.{ending}"));
        write(&path, &matrix).expect("a file");
        std::fs::read(&path).expect("a file")
    };
    match format {
        "matrix-market" => written("mtx"),
        "npz" => written("npz"),
        "npy" => {
            // Numbers of one byte are the worst case: 16 bytes of memory for each.
            let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
            let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (1000, 1000), }";
            bytes.extend(format!("{header:117}\n").into_bytes());
            bytes.extend((0..FULL * FULL).map(|at| u8::from(at % 7 < 3)));
            bytes
        }
        "matlab" => matlab(),
        "hdf5" => {
            let mut file = hdf5_pure::FileBuilder::new();
            let values: Vec<f64> = (0..FULL * FULL).map(|at| (at % FULL + at / FULL) as f64 + 1.0).collect();
            file.create_dataset("K").with_f64_data(&values).with_shape(&[FULL as u64, FULL as u64]);
            file.finish().expect("a file")
        }
        "coordinate" => lines(&|row, column, value| format!("{row} {column} {value}\n")),
        "abaqus-matrix-input" => lines(&|row, column, value| format!("{row},1, {column},1, {value:.15e}\n")),
        "dense-text" => {
            let number = |row, column| format!("{:.6e}", 1.5 + (row + column) as f64);
            let row = |row| (0..FULL).map(|column| number(row, column)).collect::<Vec<_>>().join(" ") + "\n";
            (0..FULL).map(row).collect::<String>().into_bytes()
        }
        "abaqus-element" => {
            let nodes: Vec<String> = (1..=FULL).map(|node| node.to_string()).collect();
            let mut text = format!("*USER ELEMENT,NODES={FULL},LINEAR\n** ELEMENT NODES\n");
            nodes.chunks(8).for_each(|some| text += &format!("** {},\n", some.join(", ")));
            text += "1\n*MATRIX,TYPE=STIFFNESS\n";
            for row in 0..FULL {
                let values: Vec<String> =
                    (0..=row).map(|column| format!("{:.12e}", 1.5 + (row + column) as f64)).collect();
                values.chunks(4).for_each(|some| text += &format!("{},\n", some.join(",")));
            }
            text.into_bytes()
        }
        "nastran-dmig" => {
            let mut cards = b"DMIG    K              0       6       2\n".to_vec();
            cards.extend(lines(&|row, column, value| {
                format!("DMIG*   {:16}{column:16}{:16}{:16}\n*       {row:16}{:16}{value:16.9e}\n", "K", 1, "", 1)
            }));
            cards
        }
        "nastran-op4" => {
            let mut text = format!("{FULL:8}{FULL:8}{:8}{:8}{:8}1P,3E23.16\n", 6, 2, "K");
            let value = |row: usize, column: usize| format!("{:>23}", fortran(1.5 + (row + column) as f64));
            for column in 0..FULL {
                text += &format!("{:8}{:8}{FULL:8}\n", column + 1, 1);
                let values: Vec<String> = (0..FULL).map(|row| value(row, column)).collect();
                values.chunks(3).for_each(|some| text += &format!("{}\n", some.concat()));
            }
            text += &format!("{:8}{:8}{:8}\n{:>23}\n", FULL + 1, 1, 1, fortran(1.0));
            text.into_bytes()
        }
        "nastran-op2" => {
            let mut bytes = Vec::new();
            let mut record = |data: &[u8]| {
                let length = (data.len() as u32).to_le_bytes();
                bytes.extend([&length[..], data, &length[..]].concat());
            };
            let words = |values: &[i32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
            let size = FULL as i32;
            for head in [&b"K       "[..], &words(&[101, size, size, 6, 1, size, 0]), b"K       "] {
                record(&words(&[head.len() as i32 / 4]));
                record(head);
                let behind: &[i32] = match head.len() {
                    8 => &[-1],
                    _ => &[-2, 1, 0],
                };
                behind.iter().for_each(|key| record(&words(&[*key])));
            }
            [1, 1].iter().for_each(|key| record(&words(&[*key])));
            for column in 0..size {
                record(&words(&[1 + size]));
                let values = (0..size).flat_map(|row| (1.5 + (row + column) as f32).to_le_bytes());
                record(&words(&[1]).into_iter().chain(values).collect::<Vec<u8>>());
                [-4, 1, i32::from(column + 1 < size)].iter().for_each(|key| record(&words(&[*key])));
            }
            [0, 0].iter().for_each(|key| record(&words(&[*key])));
            bytes
        }
        "harwell-boeing" => {
            let block =
                |words: Vec<String>, per: usize| -> Vec<String> { words.chunks(per).map(<[String]>::concat).collect() };
            let first = (0..=CHAIN).map(|column| format!("{:10}", (2 * column).min(2 * CHAIN - 1) + 1));
            let parts = [
                block(first.collect(), 8),
                block(chain().map(|(row, ..)| format!("{row:10}")).collect(), 8),
                block(chain().map(|(.., value)| format!("{:>25}", fortran(value))).collect(), 3),
            ];
            let [columns, rows, values] = parts.each_ref().map(Vec::len);
            let mut text = format!("{:72}{:8}\n", "Stiffness matrix", "KMAT");
            text += &format!("{:14}{columns:14}{rows:14}{values:14}{:14}\n", columns + rows + values, 0);
            text += &format!("{:14}{CHAIN:14}{CHAIN:14}{:14}{:14}\n", "RSA", 2 * CHAIN - 1, 0);
            text += &format!("{:16}{:16}{:20}{:20}\n", "(8I10)", "(8I10)", "(3E25.16)", "");
            text += &(parts.concat().join("\n") + "\n");
            text.into_bytes()
        }
        "ansys-full" => ansys_full(),
        other => panic!("write a large file of {other} here"),
    }
}

/// Returns a number in Fortran notation: an exponent of two digits with a sign.
fn fortran(value: f64) -> String {
    let text = format!("{value:.16E}");
    let (digits, exponent) = text.split_once('E').expect("an exponent");
    format!("{digits}E{:+03}", exponent.parse::<i32>().expect("a number"))
}

/// Returns a MAT-file of version 5 with a sparse matrix: flags, sizes, name,
/// rows, first entries of columns, values.
fn matlab() -> Vec<u8> {
    let part = |kind: u32, data: Vec<u8>| -> Vec<u8> {
        let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    let whole = |kind: u32, values: Vec<u32>| part(kind, values.into_iter().flat_map(u32::to_le_bytes).collect());
    let (n, count) = (CHAIN as u32, 2 * CHAIN as u32 - 1);
    // The lower triangle only: both would take equally many numbers for each entry.
    let rows = (0..n).flat_map(|i| [i, i + 1]).take(count as usize).collect();
    let values = (0..count).flat_map(|at| (1.0 + f64::from(at)).to_le_bytes()).collect();
    let (sparse, int8, int32, uint32, double) = (5, 1, 5, 6, 9);
    let matrix = [
        whole(uint32, vec![sparse, count]),
        whole(int32, vec![n, n]),
        part(int8, b"K".to_vec()),
        whole(int32, rows),
        whole(int32, (0..=n).map(|column| (2 * column).min(count)).collect()),
        part(double, values),
    ];
    let mut bytes = format!("{:124}", "MATLAB 5.0 MAT-file").into_bytes();
    bytes.extend(b"\x00\x01IM");
    bytes.extend(part(14, matrix.concat()));
    bytes
}

/// Returns a file of ANSYS: the standard header, the header of the matrices,
/// and the stiffness by two records per row.
fn ansys_full() -> Vec<u8> {
    fn record(words: &mut Vec<u32>, flags: u32, data: &[u32]) -> u32 {
        let start = words.len() as u32;
        words.extend([data.len() as u32, flags]);
        words.extend(data);
        words.push(0);
        start
    }
    let (integers, n, mut words) = (1 << 31, CHAIN as u32, Vec::new());
    let mut standard = vec![0; 100];
    standard[0] = 4;
    record(&mut words, integers, &standard);
    let header = record(&mut words, integers, &[0; 160]) as usize + 2;
    record(&mut words, integers, &[1, 2, 3]);
    let nodes: Vec<u32> = (1..=n).collect();
    record(&mut words, integers, &nodes);
    let mut first = None;
    for row in 1..=n {
        let last = row == n;
        // The columns from the diagonal on, the diagonal last.
        let columns = if last { vec![row] } else { vec![row + 1, row] };
        let start = record(&mut words, integers, &columns);
        first.get_or_insert(start);
        let values = [-1.0, 2.0 + f64::from(row)];
        let halves = |value: &f64| [value.to_bits() as u32, (value.to_bits() >> 32) as u32];
        let values: Vec<u32> = values[usize::from(last)..].iter().flat_map(halves).collect();
        record(&mut words, 0, &values);
    }
    let each = record(&mut words, integers, &vec![1; CHAIN]);
    record(&mut words, integers, &vec![1; CHAIN]);
    for (item, value) in [(0, -4i32 as u32), (1, n), (2, n), (3, 1), (4, 2), (18, first.unwrap_or(0)), (35, each)] {
        words[header + item] = value;
    }
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// Memory is at most ten times the file, for every format.
#[test]
fn memory_follows_the_file() {
    for format in TABLE {
        let bytes = large(format.name);
        let mut matrix = None;
        let memory = peak_memory(|| matrix = Some(read_bytes(&bytes, None, None)));
        let matrix = matrix.expect("a result").unwrap_or_else(|error| panic!("{}: {error}", format.name));
        assert_eq!(matrix.origin().format, format.name);
        assert!(bytes.len() >= 1_000_000 && matrix.entries().len() > 190_000, "{}: {}", format.name, bytes.len());
        assert!(
            memory <= 10 * bytes.len() as u64,
            "{}: {memory} bytes of memory for {} bytes",
            format.name,
            bytes.len()
        );
        eprintln!("{}: {:.1} times its {} bytes", format.name, memory as f64 / bytes.len() as f64, bytes.len());
    }
}

/// One damaged index far beyond all others does not create rows.
#[test]
fn damaged_index_is_too_large() {
    let mut text: String = (1..=100_000).map(|row| format!("{row} {row} 2.0\n")).collect();
    assert_eq!(read_bytes(text.as_bytes(), None, None).expect("a diagonal").rows(), 100_000);
    text += "14889400 14889400 1.0\n";
    let mut error = String::new();
    let memory = peak_memory(|| {
        error = read_bytes(text.as_bytes(), None, None).expect_err("more rows than bytes").to_string();
    });
    assert!(error.contains("14889400 rows") && error.contains("damaged"), "{error}");
    assert!(memory <= 10 * text.len() as u64, "{memory} bytes of memory for {}", text.len());
}
