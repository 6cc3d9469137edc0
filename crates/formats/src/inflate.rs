//! Compressed parts of files, unpacked up to a bound.

use std::io::Read;

use flate2::read::{DeflateDecoder, ZlibDecoder};

use crate::error::{Error, Kind, Place};

/// How much larger than its file a compressed part may become, beyond [`ALWAYS`].
///
/// Deflate can pack 1030 bytes into one, which makes bombs possible. Matrices of regular meshes, whose values repeat, reach 40.
pub const EXPANSION: usize = 100;

/// Bytes that any compressed part may have.
const ALWAYS: usize = 1 << 20;

/// The two wrappings of deflate.
#[derive(Clone, Copy)]
pub(crate) enum Wrapping {
    /// With header and checksum, in MATLAB files.
    Zlib,
    /// Bare, in zip files.
    Bare,
}

/// Unpacks all of `packed`.
pub(crate) fn inflate(packed: &[u8], wrapping: Wrapping, place: &Place) -> Result<Vec<u8>, Error> {
    let most = ALWAYS.max(packed.len().saturating_mul(EXPANSION));
    let (bytes, damage) = up_to(packed, wrapping, most + 1);
    let fault = |kind, problem: String, remedy: &str| Err(Error::new(kind, place.clone(), problem, remedy));
    if bytes.len() > most {
        let problem = format!("{} compressed bytes become more than {most}", packed.len());
        return fault(Kind::TooLarge, problem, "save it without compression");
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
        let bomb = pack(&vec![0; 40 << 20])?;
        assert!(bomb.len() < 50_000);
        let found = inflate(&bomb, Wrapping::Zlib, &Place::Byte(7)).map_err(|e| (e.kind, e.place));
        assert_eq!(found, Err((Kind::TooLarge, Place::Byte(7))));
        assert_eq!(beginning(&bomb, Wrapping::Zlib, 5), [0; 5]);
        Ok(())
    }

    #[test]
    fn what_is_damaged_or_short_is_refused() -> std::io::Result<()> {
        let packed = pack(b"a text that is packed")?;
        assert_eq!(inflate(&packed, Wrapping::Zlib, &Place::File).as_deref(), Ok(&b"a text that is packed"[..]));
        let short = inflate(&packed[..packed.len() - 6], Wrapping::Zlib, &Place::File);
        assert_eq!(short.map_err(|e| e.kind), Err(Kind::Malformed));
        Ok(())
    }
}
