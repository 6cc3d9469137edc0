//! Reproducible random numbers: each is a function of a seed and an index, computed by exact
//! operations, with the same bits on every machine.
//!
//! Sources: Steele, Lea, Flood (2014), "Fast splittable pseudorandom number generators" (the
//! mixing of SplitMix64); Wichura (1988), "Algorithm AS 241: the percentage points of the
//! normal distribution", accurate to about 1e-16.

/// The random numbers of one seed.
///
/// # Example
/// ```
/// use stickslip_numerics::random::Stream;
/// let stream = Stream::new(7);
/// let many: Vec<f64> = (0..10_000).map(|i| stream.normal(i)).collect();
/// let mean = many.iter().sum::<f64>() / 1e4;
/// assert!(mean.abs() < 0.03);
/// assert_eq!(stream.normal(3), many[3]); // in any order of the indices
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream {
    seed: u64,
}

/// The generator SplitMix64: a state that grows by a constant, and a function that mixes it.
///
/// # Example
/// ```
/// use stickslip_numerics::random::SplitMix64;
/// let mut numbers = SplitMix64::new(0);
/// assert_eq!(numbers.next_u64(), 0xe220_a839_7b1d_cdaf); // as published
/// let mut later = SplitMix64::new(0).skip(1);
/// assert_eq!(numbers.next_u64(), later.next_u64());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SplitMix64 {
    state: u64,
}

impl SplitMix64 {
    /// Increment of the state, odd: 2⁶⁴ divided by the golden ratio.
    pub const INCREMENT: u64 = 0x9e37_79b9_7f4a_7c15;

    /// Creates a generator.
    pub fn new(state: u64) -> Self {
        SplitMix64 { state }
    }

    /// Returns the generator after `count` more numbers.
    pub fn skip(self, count: u64) -> Self {
        SplitMix64 { state: self.state.wrapping_add(count.wrapping_mul(Self::INCREMENT)) }
    }

    /// Returns the next 64 bits.
    pub fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(Self::INCREMENT);
        mix64(self.state)
    }

    /// Returns the next number in [0, 1), a multiple of 2⁻⁵³.
    pub fn next_unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Mixes 64 bits: every bit of the result depends on every bit of `z`.
pub fn mix64(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Returns the middle of one of 2⁵³ equal parts of the interval from 0 to 1, so never an end.
pub fn open_unit(bits: u64) -> f64 {
    ((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}

impl Stream {
    /// Creates the stream of a seed. Streams of consecutive seeds are not correlated.
    pub fn new(seed: u64) -> Self {
        Stream { seed: SplitMix64::new(seed).next_u64() }
    }

    /// Returns number `index`, uniform in the open interval (0, 1).
    pub fn uniform(self, index: u64) -> f64 {
        open_unit(SplitMix64::new(self.seed).skip(index).next_u64())
    }

    /// Returns number `index` of the normal distribution with mean 0 and standard deviation 1.
    pub fn normal(self, index: u64) -> f64 {
        normal_quantile(self.uniform(index))
    }
}

/// Returns the quantile of the standard normal distribution at probability `p`, 0 < p < 1.
pub fn normal_quantile(p: f64) -> f64 {
    let q = p - 0.5;
    let tail = || (-libm::log(if q < 0.0 { p } else { 1.0 - p })).sqrt();
    normal_quantile_from(q, 0.180_625 - q * q, tail)
}

/// Returns the quantile of the standard normal distribution at probability `0.5 + q`.
///
/// The caller computes the arguments of the rational approximations, because their last digits
/// decide the last digits of the result: `center = 0.425² - q²`, and `tail` returns
/// `√(-ln min(p, 1 - p))`.
pub fn normal_quantile_from(q: f64, center: f64, tail: impl FnOnce() -> f64) -> f64 {
    let ratio = |x: f64, up: [f64; 8], down: [f64; 7]| {
        let top = up.iter().rev().fold(0.0, |sum, c| sum * x + c);
        let bottom = down.iter().rev().fold(0.0, |sum, c| (sum + c) * x);
        top / (bottom + 1.0)
    };
    if q.abs() <= 0.425 {
        return q * ratio(center, CENTER.0, CENTER.1);
    }
    let r = tail();
    let value = if r <= 5.0 { ratio(r - 1.6, TAIL.0, TAIL.1) } else { ratio(r - 5.0, FAR_TAIL.0, FAR_TAIL.1) };
    if q < 0.0 { -value } else { value }
}

type RationalCoefficients = ([f64; 8], [f64; 7]);

#[allow(clippy::excessive_precision)] // as published
const CENTER: RationalCoefficients = (
    [
        3.387_132_872_796_366_608_0,
        1.331_416_678_917_843_774_5e2,
        1.971_590_950_306_551_442_7e3,
        1.373_169_376_550_946_112_5e4,
        4.592_195_393_154_987_145_7e4,
        6.726_577_092_700_870_085_3e4,
        3.343_057_558_358_812_810_5e4,
        2.509_080_928_730_122_672_7e3,
    ],
    [
        4.231_333_070_160_091_125_2e1,
        6.871_870_074_920_579_083_0e2,
        5.394_196_021_424_751_107_7e3,
        2.121_379_430_158_659_586_7e4,
        3.930_789_580_009_271_061_0e4,
        2.872_908_573_572_194_267_4e4,
        5.226_495_278_852_854_561_0e3,
    ],
);

#[allow(clippy::excessive_precision)]
const TAIL: RationalCoefficients = (
    [
        1.423_437_110_749_683_577_34,
        4.630_337_846_156_545_295_90,
        5.769_497_221_460_691_405_50,
        3.647_848_324_763_204_605_04,
        1.270_458_252_452_368_382_58,
        2.417_807_251_774_506_117_70e-1,
        2.272_384_498_926_918_458_33e-2,
        7.745_450_142_783_414_076_40e-4,
    ],
    [
        2.053_191_626_637_758_821_87,
        1.676_384_830_183_803_849_40,
        6.897_673_349_851_000_045_50e-1,
        1.481_039_764_274_800_745_90e-1,
        1.519_866_656_361_645_719_66e-2,
        5.475_938_084_995_344_946_00e-4,
        1.050_750_071_644_416_843_24e-9,
    ],
);

#[allow(clippy::excessive_precision)]
const FAR_TAIL: RationalCoefficients = (
    [
        6.657_904_643_501_103_777_20,
        5.463_784_911_164_114_369_90,
        1.784_826_539_917_291_335_80,
        2.965_605_718_285_048_912_30e-1,
        2.653_218_952_657_612_309_30e-2,
        1.242_660_947_388_078_438_60e-3,
        2.711_555_568_743_487_578_15e-5,
        2.010_334_399_292_288_132_65e-7,
    ],
    [
        5.998_322_065_558_879_376_90e-1,
        1.369_298_809_227_358_053_10e-1,
        1.487_536_129_085_061_485_25e-2,
        7.868_691_311_456_132_591_00e-4,
        1.846_318_317_510_054_681_80e-5,
        1.421_511_758_316_445_888_70e-7,
        2.044_263_103_389_939_785_64e-15,
    ],
);

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: `statistics.NormalDist().inv_cdf` of Python.
    #[test]
    fn quantiles_are_those_of_python() {
        for (p, expected) in [
            (0.5, 0.0),
            (0.3, -0.524_400_512_708_041),
            (0.975, 1.959_963_984_540_054),
            (0.999, 3.090_232_306_167_813),
            (1e-6, -4.753_424_308_822_899),
            (1e-14, -7.650_628_092_935_268),
        ] {
            let found = normal_quantile(p);
            assert!((found - expected).abs() < 4e-15 * (1.0 + found.abs()), "{p}: {found} {expected}");
        }
    }

    /// The first numbers of SplitMix64's mixing are fixed: studies with seeds must not change.
    #[test]
    fn seeds_are_stable() {
        // Stafford's variant 13: mix64(1) computed by hand from the published code.
        assert_eq!(mix64(1), 0x5692_161d_100b_05e5);
        let stream = Stream::new(7);
        let mut numbers: Vec<u64> = (0..1000).map(|i| stream.uniform(i).to_bits()).collect();
        numbers.sort_unstable();
        numbers.dedup();
        assert_eq!(numbers.len(), 1000);
    }

    /// Mean, variance, kurtosis and the correlation of consecutive numbers,
    /// within five standard errors.
    #[test]
    fn normal_numbers_are_normal() {
        let n = 200_000u64;
        for seed in [0, 1, 12345] {
            let stream = Stream::new(seed);
            let x: Vec<f64> = (0..n).map(|i| stream.normal(i)).collect();
            let moment = |k: i32| x.iter().map(|x| x.powi(k)).sum::<f64>() / n as f64;
            let error = 5.0 / (n as f64).sqrt();
            assert!(moment(1).abs() < error && (moment(2) - 1.0).abs() < 1.5 * error, "{seed}");
            assert!((moment(4) - 3.0).abs() < 10.0 * error, "{seed}: {}", moment(4));
            let serial = x.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / n as f64;
            let other = Stream::new(seed + 1);
            let across = (0..n).map(|i| other.normal(i) * x[i as usize]).sum::<f64>() / n as f64;
            assert!(serial.abs() < error && across.abs() < error, "{seed}: {serial} {across}");
        }
    }
}
