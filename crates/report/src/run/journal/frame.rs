//! Frames of a journal: length, checksum and payload, so that an incomplete frame is detected.

use std::io::Read;

/// Limit of the length of a frame; a larger length is invalid.
pub(super) const MAX_LENGTH: u32 = 1 << 31;
/// Number of bytes before the payload of a frame.
pub(super) const PREFIX: u64 = 8;

pub(super) fn check(length: u32, payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&length.to_le_bytes());
    hasher.update(payload);
    hasher.finalize()
}

/// Reads the payload of the next frame. Returns `None` if there is no complete, valid frame.
///
/// `left` is the number of remaining bytes in the file.
pub(super) fn frame(reader: &mut impl Read, left: u64) -> std::io::Result<Option<Vec<u8>>> {
    if left < PREFIX {
        return Ok(None);
    }
    let (mut length, mut sum) = ([0; 4], [0; 4]);
    reader.read_exact(&mut length)?;
    reader.read_exact(&mut sum)?;
    let length = u32::from_le_bytes(length);
    if length >= MAX_LENGTH || PREFIX + u64::from(length) > left {
        return Ok(None);
    }
    let mut payload = vec![0; length as usize];
    reader.read_exact(&mut payload)?;
    Ok((check(length, &payload) == u32::from_le_bytes(sum)).then_some(payload))
}
