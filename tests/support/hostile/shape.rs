//! Meshes and configurations as a fuzzer chooses them: from any bytes, with any stride, and with so few
//! triangles that brute force is quick.

use arbitrary::{Arbitrary, Result, Unstructured};
use hgrid_core::{
    BuildFlags, Config, Error, IndexType, MAX_COORDINATE, MeshPart, Method, Parameters, Quality,
    Strided, TriangleMesh,
};

use super::memory::rarely;

/// The most triangles that a fuzzer writes down, and the most after repetition.
const MOST: usize = if cfg!(miri) { 6 } else { 48 };
const MOST_REPEATED: usize = if cfg!(miri) { 12 } else { 400 };

/// A way to choose coordinates.
#[derive(Debug, Clone, Copy, Arbitrary)]
enum Numbers {
    /// Small integers times a power of two: equal coordinates, planes, vertices on borders.
    Whole { exponent: i8 },
    /// Values from a table of special floats.
    Odd,
    /// Any bits.
    Any,
    /// Integers times any power of two, each with its own.
    Mixed,
}

/// Floats of every kind.
const ODD: [f32; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1.0 + f32::EPSILON,
    0.999_999_94,
    0.5,
    3.0,
    1e-45,
    -1e-45,
    f32::MIN_POSITIVE,
    1e-30,
    1e-10,
    1e-5,
    1e5,
    16_777_216.0,
    1e10,
    1e30,
    MAX_COORDINATE,
    -MAX_COORDINATE,
    f32::MAX,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
];

impl Numbers {
    fn one(self, u: &mut Unstructured<'_>) -> Result<f32> {
        Ok(match self {
            Self::Whole { exponent } => {
                f32::from(i8::arbitrary(u)?) * 2_f32.powi(i32::from(exponent) * 7 / 8)
            }
            Self::Odd => ODD[usize::from(u8::arbitrary(u)?) % ODD.len()],
            Self::Any => f32::from_bits(u32::arbitrary(u)?),
            Self::Mixed => {
                let [number, exponent] = <[i8; 2]>::arbitrary(u)?;
                f32::from(number) * 2_f32.powi(exponent.into())
            }
        })
    }
}

/// Vertices and triangles in memory of their own, which ends with the last element.
#[derive(Debug)]
pub(super) struct Shape {
    pub(super) positions: Vec<u8>,
    pub(super) position_stride: usize,
    pub(super) vertex_count: usize,
    pub(super) indices: Vec<u8>,
    pub(super) index_stride: usize,
    pub(super) triangle_count: usize,
    pub(super) index_type: IndexType,
    /// Four bytes for each triangle, with a gap before the next; or no bytes at all.
    pub(super) masks: Vec<u8>,
    pub(super) mask_stride: usize,
}

impl Shape {
    /// Reads the mesh that the bytes describe.
    pub(super) fn new(u: &mut Unstructured<'_>) -> Result<Self> {
        let numbers = Numbers::arbitrary(u)?;
        let index_type = if bool::arbitrary(u)? { IndexType::U16 } else { IndexType::U32 };
        let [position_gap, index_gap] = <[u8; 2]>::arbitrary(u)?.map(|gap| usize::from(gap % 8));
        let (copies, shrink) = (usize::from(u8::arbitrary(u)? % 16), u8::arbitrary(u)?);
        let is_stranger_allowed = rarely(u, 16)?;

        let mut vertices = Vec::new();
        for _ in 0..u.int_in_range(0..=2 * MOST)? {
            let mut one = || numbers.one(u);
            vertices.push([one()?, one()?, one()?]);
        }
        let mut triangles = Vec::new();
        for _ in 0..u.int_in_range(0..=MOST)? {
            let corners = <[u8; 3]>::arbitrary(u)?.map(usize::from);
            let count = (vertices.len() + usize::from(is_stranger_allowed)).max(1);
            triangles.push(corners.map(|corner| corner % count));
        }
        // Make crowds: copies about the first vertex, each smaller than the last.
        let (first, count) = (vertices.clone(), triangles.len());
        for copy in 1..=copies.min(MOST_REPEATED / count.max(1)) {
            let scale = 2_f32.powi(-((copy * usize::from(shrink % 32)) as i32 / 8));
            let Some(&center) = first.first() else { break };
            let start = vertices.len();
            vertices.extend(first.iter().map(|vertex| -> [f32; 3] {
                std::array::from_fn(|k| center[k] + (vertex[k] - center[k]) * scale)
            }));
            let again: Vec<_> = triangles[..count].iter().map(|t| t.map(|v| v + start)).collect();
            triangles.extend(again);
        }

        let index_bytes = if index_type == IndexType::U16 { 2 } else { 4 };
        let (position_stride, index_stride) = (12 + position_gap, 3 * index_bytes + index_gap);
        let mut positions = Vec::new();
        for (i, vertex) in vertices.iter().enumerate() {
            positions.resize(i * position_stride, 0xa5);
            positions.extend(vertex.iter().flat_map(|c| c.to_ne_bytes()));
        }
        let mut indices = Vec::new();
        for (i, triangle) in triangles.iter().enumerate() {
            indices.resize(i * index_stride, 0xa5);
            match index_type {
                IndexType::U16 => {
                    indices.extend(triangle.iter().flat_map(|&v| (v as u16).to_ne_bytes()));
                }
                IndexType::U32 => {
                    indices.extend(triangle.iter().flat_map(|&v| (v as u32).to_ne_bytes()));
                }
            }
        }
        let (vertex_count, triangle_count) = (vertices.len(), triangles.len());
        let (mut masks, mask_stride) = (Vec::new(), 4 + usize::from(u8::arbitrary(u)? % 5));
        if bool::arbitrary(u)? {
            for i in 0..triangle_count {
                masks.resize(i * mask_stride, 0xa5);
                masks.extend(u32::from(u8::arbitrary(u)?).to_ne_bytes());
            }
        }
        Ok(Self {
            positions,
            position_stride,
            vertex_count,
            indices,
            index_stride,
            triangle_count,
            index_type,
            masks,
            mask_stride,
        })
    }

    /// Returns the mesh in the library's form.
    pub(super) fn view(&self) -> TriangleMesh<'_> {
        let positions = [self.position_stride, self.vertex_count];
        let indices = [self.index_stride, self.triangle_count];
        let view = self.strided(positions, indices).expect("a sound mesh");
        if self.masks.is_empty() {
            return view;
        }
        let (bytes, stride, count) = (&self.masks, self.mask_stride, self.triangle_count);
        view.with_masks(Strided { bytes, stride, count }).expect("a mask for each triangle")
    }

    /// Returns the same triangles in parts, cut at these positions, every other part without masks.
    pub(super) fn parts<'s>(&'s self, cuts: &[u8]) -> Vec<MeshPart<'s>> {
        let mut ends: Vec<_> =
            cuts.iter().map(|&cut| cut as usize % (self.triangle_count + 1)).collect();
        ends.push(self.triangle_count);
        ends.sort_unstable();
        let starts = [0].into_iter().chain(ends.clone());
        let parts = starts.zip(ends).enumerate().map(|(at, (start, end))| {
            let count = end - start;
            let from = |bytes: &'s [u8], stride: usize| {
                // After the last triangle there are no bytes, not even the rest of its stride.
                let start = if count == 0 { 0 } else { start * stride };
                Strided { bytes: &bytes[start..], stride, count }
            };
            let positions = Strided {
                bytes: &self.positions,
                stride: self.position_stride,
                count: self.vertex_count,
            };
            let indices = from(&self.indices, self.index_stride);
            let mesh = TriangleMesh::strided(positions, indices, self.index_type);
            let mesh = mesh.expect("a sound mesh");
            MeshPart::new(if self.masks.is_empty() || at % 2 == 1 {
                mesh
            } else {
                let masks = from(&self.masks, self.mask_stride);
                mesh.with_masks(masks).expect("a mask for each triangle")
            })
        });
        parts.collect()
    }

    /// Describes the same bytes with other strides and counts.
    pub(super) fn strided(
        &self,
        [position_stride, vertex_count]: [usize; 2],
        [index_stride, triangle_count]: [usize; 2],
    ) -> core::result::Result<TriangleMesh<'_>, Error> {
        let strided = |bytes, stride, count| Strided { bytes, stride, count };
        TriangleMesh::strided(
            strided(&self.positions, position_stride, vertex_count),
            strided(&self.indices, index_stride, triangle_count),
            self.index_type,
        )
    }
}

/// A float in a configuration.
#[derive(Debug, Clone, Copy, Arbitrary)]
enum Setting {
    Default,
    /// A valid value: 2^-8 to 2^8 times the default.
    Power(i8),
    Odd(u8),
    Any(f32),
}

impl Setting {
    fn or(self, default: f32) -> f32 {
        match self {
            Self::Default => default,
            Self::Power(exponent) => default * 2_f32.powf(f32::from(exponent) / 16.0),
            Self::Odd(which) => ODD[usize::from(which) % ODD.len()],
            Self::Any(number) => number,
        }
    }
}

/// A count in a configuration.
#[derive(Debug, Clone, Copy, Arbitrary)]
enum Count {
    Default,
    Small(u8),
    Any(u32),
}

impl Count {
    fn or(self, default: u32) -> u32 {
        match self {
            Self::Default => default,
            Self::Small(count) => u32::from(count % 16),
            Self::Any(count) => count,
        }
    }
}

/// The configuration as C has it: the fields of all methods.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chosen {
    pub(super) method: Method,
    pub(super) density: f32,
    pub(super) macrocell_factor: u32,
    pub(super) subdivide_above: u32,
    pub(super) depth: u32,
    pub(super) quality: Quality,
    pub(super) flags: BuildFlags,
}

/// Reads the configuration that the bytes describe.
pub(super) fn config(u: &mut Unstructured<'_>) -> Result<Config> {
    let Chosen { method, density, macrocell_factor, subdivide_above, depth, quality, flags } =
        chosen(u)?;
    let parameters = match method {
        Method::Fixed => Parameters::Fixed { density, macrocell_factor },
        Method::Variable => Parameters::Variable { density, subdivide_above },
        Method::Recursive => Parameters::Recursive { density, depth },
        Method::Bvh => Parameters::Bvh { quality },
        _ => Parameters::new(method).with_density(density),
    };
    Ok(Config { parameters, flags })
}

/// Reads the fields that the bytes describe.
pub(super) fn chosen(u: &mut Unstructured<'_>) -> Result<Chosen> {
    let which = usize::from(u8::arbitrary(u)?);
    let method = Method::ALL[which % Method::ALL.len()];
    let quality = Quality::ALL[which / Method::ALL.len() % Quality::ALL.len()];
    let mut count = |default| Count::arbitrary(u).map(|count| count.or(default));
    let [macrocell_factor, subdivide_above, depth] = [count(3)?, count(4)?, count(3)?];
    let mut setting = |default| Setting::arbitrary(u).map(|setting| setting.or(default));
    let density = setting(Parameters::new(method).density().unwrap_or(4.0))?;
    let flags = match u8::arbitrary(u)? {
        0..=199 => 0,
        200..=249 => 1,
        _ => u32::arbitrary(u)?,
    };
    let flags = BuildFlags::from_bits_retain(flags);
    Ok(Chosen { method, density, macrocell_factor, subdivide_above, depth, quality, flags })
}
