//! Decompresses parts of files, up to a limit.

use std::io::Read;

use flate2::read::{DeflateDecoder, MultiGzDecoder, ZlibDecoder};
use ruzstd::decoding::StreamingDecoder;

use crate::error::{Error, ErrorKind, Location};

/// Maximum ratio of decompressed size to file size, beyond [`MIN_DECOMPRESSED_LIMIT`].
///
/// Deflate compresses up to 1030 bytes into one, which makes decompression bombs possible. A sparse
/// stiffness matrix of a regular mesh, with repeated values, shrinks to a 25th. Parts of files,
/// such as the equal values of a mass matrix, and full matrices of mostly zeros shrink to a 900th.
pub const MAX_EXPANSION: usize = 100;

/// Decompressed size in bytes that is always accepted: a full matrix of 5800 rows.
pub const MIN_DECOMPRESSED_LIMIT: usize = 256 << 20;

/// Limit on the decompressed bytes of a file.
#[derive(Clone, Copy)]
pub(crate) struct DecompressionLimit(usize);

impl DecompressionLimit {
    /// Returns the limit for a file of `file` bytes.
    pub fn for_file(file: usize) -> Self {
        Self(MIN_DECOMPRESSED_LIMIT.max(file.saturating_mul(MAX_EXPANSION)))
    }

    /// Returns the limit in numbers of 8 bytes.
    pub fn numbers(self) -> u64 {
        (self.0 / size_of::<f64>()) as u64
    }
}

/// The containers of deflate, and Zstandard.
#[derive(Clone, Copy)]
pub(crate) enum Container {
    /// With header and checksum, in MATLAB files.
    Zlib,
    /// Without header, in zip files.
    Bare,
    /// Gzip, in Parquet tables.
    Gzip,
    /// Zstandard, in Parquet tables.
    Zstandard,
}

/// Decompresses all of `packed`.
pub(crate) fn inflate(
    packed: &[u8],
    container: Container,
    limit: DecompressionLimit,
    location: &Location,
) -> Result<Vec<u8>, Error> {
    let most = limit.0;
    let (bytes, damage) = up_to(packed, container, most + 1);
    let fault = |kind, problem: String, remedy: &str| Err(Error::new(kind, location.clone(), problem, remedy));
    if bytes.len() > most {
        let problem =
            format!("{} compressed bytes expand to more than {most} bytes, the limit for this file", packed.len());
        return fault(ErrorKind::TooLarge, problem, "save it as a sparse matrix, or without compression");
    }
    match damage {
        None => Ok(bytes),
        Some(error) => {
            let problem = format!("the compressed part is damaged: {error}");
            fault(ErrorKind::Malformed, problem, "export or copy the file again")
        }
    }
}

/// Returns the first `count` decompressed bytes, fewer if the data ends or is damaged.
pub(crate) fn beginning(packed: &[u8], container: Container, count: usize) -> Vec<u8> {
    up_to(packed, container, count).0
}

fn up_to(packed: &[u8], container: Container, count: usize) -> (Vec<u8>, Option<std::io::Error>) {
    let mut bytes = Vec::new();
    let most = count as u64;
    let end = match container {
        Container::Zlib => ZlibDecoder::new(packed).take(most).read_to_end(&mut bytes),
        Container::Bare => DeflateDecoder::new(packed).take(most).read_to_end(&mut bytes),
        Container::Gzip => MultiGzDecoder::new(packed).take(most).read_to_end(&mut bytes),
        Container::Zstandard => match StreamingDecoder::new(packed) {
            Ok(decoder) => decoder.take(most).read_to_end(&mut bytes),
            Err(error) => Err(std::io::Error::other(error)),
        },
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
    fn decompression_bomb_is_refused() -> std::io::Result<()> {
        let limit = DecompressionLimit::for_file(1);
        let bomb = pack(&vec![0; MIN_DECOMPRESSED_LIMIT + 1])?;
        assert!(bomb.len() < 300_000);
        let found = inflate(&bomb, Container::Zlib, limit, &Location::Byte(7)).map_err(|e| (e.kind, e.location));
        assert_eq!(found, Err((ErrorKind::TooLarge, Location::Byte(7))));
        assert_eq!(beginning(&bomb, Container::Zlib, 5), [0; 5]);
        Ok(())
    }

    #[test]
    fn damaged_data_is_refused() -> std::io::Result<()> {
        let packed = pack(b"a text that is packed")?;
        assert_eq!(
            inflate(&packed, Container::Zlib, DecompressionLimit::for_file(1), &Location::File).as_deref(),
            Ok(&b"a text that is packed"[..])
        );
        let short =
            inflate(&packed[..packed.len() - 6], Container::Zlib, DecompressionLimit::for_file(1), &Location::File);
        assert_eq!(short.map_err(|e| e.kind), Err(ErrorKind::Malformed));
        Ok(())
    }
}
