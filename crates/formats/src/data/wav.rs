//! Sampled sound: RIFF WAVE, PCM of 8 to 32 bits and floats of 32 and 64 bits.
//!
//! Whole numbers are divided by their full scale, so that values lie between -1 and 1.
//! Source: Microsoft, Multimedia Programming Interface and Data Specifications 1.0;
//! `WAVEFORMATEXTENSIBLE`.

use super::{Column, DataFile, DataFormat};
use crate::bytes::{ByteCursor, ByteOrder};
use crate::error::{Error, ErrorKind, Location};

pub(super) const FORMAT: DataFormat = DataFormat {
    name: "wav",
    summary: "RIFF WAVE (.wav): PCM and floats, any number of channels",
    sniff: |bytes| {
        let riff = [b"RIFF", b"RIFX", b"RF64"].iter().any(|mark| bytes.starts_with(*mark));
        riff && bytes.get(8..12) == Some(b"WAVE")
    },
    read,
};

/// Codes of `WAVE_FORMAT_PCM`, `WAVE_FORMAT_IEEE_FLOAT` and `WAVE_FORMAT_EXTENSIBLE`.
const PCM: u16 = 1;
const FLOAT: u16 = 3;
const EXTENSIBLE: u16 = 0xfffe;

/// The chunk `fmt `.
struct SampleFormat {
    code: u16,
    channels: usize,
    rate: u32,
    bits: usize,
}

fn read(bytes: &[u8]) -> Result<DataFile, Error> {
    let order = if bytes.starts_with(b"RIFX") { ByteOrder::Big } else { ByteOrder::Little };
    let mut cursor = ByteCursor::new(bytes, order);
    cursor.skip(12);
    let mut notes = Vec::new();
    let mut format = None;
    while cursor.remaining() >= 8 {
        let name = cursor.take(4)?;
        let length = cursor.u32()? as usize;
        let available = length.min(cursor.remaining());
        match name {
            b"fmt " => format = Some(sample_format(ByteCursor::new(cursor.take(available)?, order))?),
            b"data" => {
                let format = format.ok_or_else(|| cursor.malformed("the chunk `fmt ` before the samples", "none"))?;
                // recorders that were switched off leave a wrong length
                if available < length && length != u32::MAX as usize {
                    notes.push(format!("the header states {length} bytes of samples; the file has {available}"));
                }
                let columns = samples(cursor.take(available)?, &format, order)?;
                return Ok(DataFile { columns, notes, ..DataFile::default() });
            }
            _ => {}
        }
        if name != b"fmt " {
            cursor.skip(available);
        }
        // chunks begin at even bytes
        cursor.skip(length % 2);
    }
    let problem = "the file has no chunk `data` with samples".to_owned();
    Err(Error::new(ErrorKind::Truncated, Location::File, problem, "record or export it again"))
}

fn sample_format(mut chunk: ByteCursor<'_>) -> Result<SampleFormat, Error> {
    let mut code = chunk.u16()?;
    let channels = chunk.u16()?;
    let rate = chunk.u32()?;
    chunk.skip(6);
    let bits = chunk.u16()?;
    if code == EXTENSIBLE {
        // size, valid bits, channel mask; the first two bytes of the identifier are the code
        chunk.skip(8);
        code = chunk.u16()?;
    }
    let known = matches!((code, bits), (PCM, 8 | 16 | 24 | 32) | (FLOAT, 32 | 64));
    if !known || channels == 0 || rate == 0 {
        let problem = format!("format {code} with {channels} channels of {bits} bits at {rate} Hz is not supported");
        let remedy = "save it as PCM of 16, 24 or 32 bits, or as floats";
        return Err(Error::new(ErrorKind::Unsupported, chunk.location(), problem, remedy));
    }
    Ok(SampleFormat { code, channels: channels.into(), rate, bits: bits.into() })
}

fn samples(data: &[u8], format: &SampleFormat, order: ByteOrder) -> Result<Vec<Column>, Error> {
    let width = format.bits / 8;
    let frames = data.len() / (width * format.channels);
    let mut cursor = ByteCursor::new(data, order);
    let mut values = vec![Vec::with_capacity(frames); format.channels];
    for _ in 0..frames {
        for channel in &mut values {
            channel.push(match (format.code, format.bits) {
                (FLOAT, 32) => f64::from(cursor.f32()?),
                (FLOAT, _) => cursor.f64()?,
                (_, 8) => (f64::from(cursor.u8()?) - 128.0) / 128.0,
                (_, 16) => f64::from(cursor.i16()?) / 32_768.0,
                (_, 24) => {
                    let [a, b, c] = <[u8; 3]>::try_from(cursor.take(3)?).unwrap_or_default();
                    let bytes = if order == ByteOrder::Little { [0, a, b, c] } else { [0, c, b, a] };
                    // the upper three of four bytes keep the sign
                    f64::from(i32::from_le_bytes(bytes)) / 2_147_483_648.0
                }
                (_, _) => f64::from(cursor.i32()?) / 2_147_483_648.0,
            });
        }
    }
    let time = (0..frames).map(|i| i as f64 / f64::from(format.rate)).collect();
    let mut columns = vec![Column { name: "time".into(), unit: "s".into(), values: time, ..Column::default() }];
    for (i, values) in values.into_iter().enumerate() {
        let label = "fraction of full scale".to_owned();
        columns.push(Column { name: format!("channel_{}", i + 1), label, values, ..Column::default() });
    }
    Ok(columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(code: u16, bits: u16, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"RIFF\x00\x00\x00\x00WAVELIST\x03\x00\x00\x00abc\x00fmt \x10\x00\x00\x00".to_vec();
        bytes.extend(code.to_le_bytes());
        bytes.extend(2u16.to_le_bytes());
        bytes.extend(8000u32.to_le_bytes());
        bytes.extend([0; 6]);
        bytes.extend(bits.to_le_bytes());
        bytes.extend(b"data");
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn every_width_has_the_same_full_scale() {
        let half = 0.5f32.to_le_bytes();
        let float: Vec<u8> = [half, (-1.0f32).to_le_bytes()].concat();
        for (code, bits, data) in [
            (1, 8, vec![192, 0]),
            (1, 16, vec![0, 0x40, 0, 0x80]),
            (1, 24, vec![0, 0, 0x40, 0, 0, 0x80]),
            (1, 32, vec![0, 0, 0, 0x40, 0, 0, 0, 0x80]),
            (3, 32, float),
        ] {
            let read = read(&file(code, bits, &data)).expect("a file");
            assert_eq!((read.columns[1].values[0], read.columns[2].values[0]), (0.5, -1.0), "{bits}");
        }
        assert!(read(&file(7, 8, &[])).is_err());
        let mut short = file(1, 16, &[0; 8]);
        short.truncate(short.len() - 4);
        assert_eq!(read(&short).expect("a file").notes.len(), 1);
    }
}
