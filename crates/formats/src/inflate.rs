//! Compressed parts of files, unpacked up to a bound.

use std::io::Read;

use flate2::read::{DeflateDecoder, ZlibDecoder};

use crate::error::{Error, Kind, Location};

/// How many times as large as its file what is unpacked may become, beyond [`UNPACKED_ALWAYS`].
///
/// Deflate can pack 1030 bytes into one, which makes bombs possible. A sparse stiffness of a regular mesh, whose values repeat, is packed
/// to a 25th; parts of files, such as the equal values of a mass, and full matrices of mostly zeros to a 900th.
pub const EXPANSION: usize = 100;

/// Bytes that may always be unpacked: a full matrix of 5800 rows.
pub const UNPACKED_ALWAYS: usize = 256 << 20;

/// How many bytes may be unpacked from a file.
#[derive(Clone, Copy)]
pub(crate) struct Limit(usize);

impl Limit {
    /// Of a file of so many bytes.
    pub fn of(file: usize) -> Self {
        Self(UNPACKED_ALWAYS.max(file.saturating_mul(EXPANSION)))
    }

    /// In numbers of 8 bytes.
    pub fn numbers(self) -> u64 {
        (self.0 / size_of::<f64>()) as u64
    }
}

/// The two wrappings of deflate.
#[derive(Clone, Copy)]
pub(crate) enum Wrapping {
    /// With header and checksum, in MATLAB files.
    Zlib,
    /// Bare, in zip files.
    Bare,
}

/// Unpacks all of `packed`.
pub(crate) fn inflate(packed: &[u8], wrapping: Wrapping, limit: Limit, location: &Location) -> Result<Vec<u8>, Error> {
    let most = limit.0;
    let (bytes, damage) = up_to(packed, wrapping, most + 1);
    let fault = |kind, problem: String, remedy: &str| Err(Error::new(kind, location.clone(), problem, remedy));
    if bytes.len() > most {
        let problem = format!("{} compressed bytes become more than {most}", packed.len());
        return fault(Kind::TooLarge, problem, "save it as a sparse matrix, or without compression");
    }
    match damage {
        None => Ok(bytes),
        Some(error) => {
            let problem = format!("the compressed part is damaged: {error}");
            fault(Kind::Malformed, problem, "export or copy the file again")
        }
    }
}

/// The first `count` bytes of what is packed, fewer where it ends or is damaged.
pub(crate) fn beginning(packed: &[u8], wrapping: Wrapping, count: usize) -> Vec<u8> {
    up_to(packed, wrapping, count).0
}

fn up_to(packed: &[u8], wrapping: Wrapping, count: usize) -> (Vec<u8>, Option<std::io::Error>) {
    let mut bytes = Vec::new();
    let most = count as u64;
    let end = match wrapping {
        Wrapping::Zlib => ZlibDecoder::new(packed).take(most).read_to_end(&mut bytes),
        Wrapping::Bare => DeflateDecoder::new(packed).take(most).read_to_end(&mut bytes),
    };
    (bytes, end.err())
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use std::io::Write;

    fn pack(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(bytes)?;
        encoder.finish()
    }

    #[test]
    fn a_bomb_stops_early() -> std::io::Result<()> {
        let limit = Limit::of(1);
        let bomb = pack(&vec![0; UNPACKED_ALWAYS + 1])?;
        assert!(bomb.len() < 300_000);
        let found = inflate(&bomb, Wrapping::Zlib, limit, &Location::Byte(7)).map_err(|e| (e.kind, e.location));
        assert_eq!(found, Err((Kind::TooLarge, Location::Byte(7))));
        assert_eq!(beginning(&bomb, Wrapping::Zlib, 5), [0; 5]);
        Ok(())
    }

    #[test]
    fn what_is_damaged_or_short_is_refused() -> std::io::Result<()> {
        let packed = pack(b"a text that is packed")?;
        assert_eq!(
            inflate(&packed, Wrapping::Zlib, Limit::of(1), &Location::File).as_deref(),
            Ok(&b"a text that is packed"[..])
        );
        let short = inflate(&packed[..packed.len() - 6], Wrapping::Zlib, Limit::of(1), &Location::File);
        assert_eq!(short.map_err(|e| e.kind), Err(Kind::Malformed));
        Ok(())
    }
}
