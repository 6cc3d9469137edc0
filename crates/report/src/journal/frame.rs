//! Frames of a journal: a length, a check, and what they hold, so that a torn one is known.

use std::io::Read;

/// No frame is longer: a length beyond it is none.
pub(super) const LONGEST: u32 = 1 << 31;
/// Bytes before the payload of a frame.
pub(super) const PREFIX: u64 = 8;

pub(super) fn check(length: u32, payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&length.to_le_bytes());
    hasher.update(payload);
    hasher.finalize()
}

/// The payload of the next frame, of which so many bytes are left in the file; `None` if there is no whole one.
pub(super) fn frame(reader: &mut impl Read, left: u64) -> std::io::Result<Option<Vec<u8>>> {
    if left < PREFIX {
        return Ok(None);
    }
    let (mut length, mut sum) = ([0; 4], [0; 4]);
    reader.read_exact(&mut length)?;
    reader.read_exact(&mut sum)?;
    let length = u32::from_le_bytes(length);
    if length >= LONGEST || PREFIX + u64::from(length) > left {
        return Ok(None);
    }
    let mut payload = vec![0; length as usize];
    reader.read_exact(&mut payload)?;
    Ok((check(length, &payload) == u32::from_le_bytes(sum)).then_some(payload))
}
