//! The Gaussians of a scene as plain arrays, and the table of the attributes that every Gaussian has.

/// `N` Gaussians. All arrays have `N` entries, except `sh_rest`, which has `N` times [`sh_rest_coefficients`] times 3.
///
/// The attributes of all scenes are fields; [`GaussianArrays::further`] has those that this scene has besides.
/// [`GaussianArrays::attributes`] iterates over both.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GaussianArrays {
    /// Centers, in world units.
    pub means: Vec<[f32; 3]>,
    /// Natural logarithms of the scales.
    pub log_scales: Vec<[f32; 3]>,
    /// Rotations `(w, x, y, z)`, not necessarily of unit length.
    pub quats: Vec<[f32; 4]>,
    /// Opacities before the sigmoid.
    pub opacity_logits: Vec<f32>,
    /// Spherical harmonics of degree 0, red, green, blue.
    pub sh_dc: Vec<[f32; 3]>,
    /// Degree of the spherical harmonics, 0 to 3.
    pub sh_degree: u8,
    /// The other coefficients, `[N, (degree + 1)^2 - 1, 3]` row-major.
    pub sh_rest: Vec<f32>,
    /// Attributes that this crate does not know.
    pub further: Vec<FurtherAttribute>,
}

/// An attribute that not every scene has.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FurtherAttribute {
    /// 1 to [`LONGEST_ATTRIBUTE_NAME`] lower-case letters, digits, `-` and `_`; unique, and none of the built-in names.
    pub name: String,
    /// Numbers a Gaussian, at least 1.
    pub width: u32,
    /// `[N, width]` row-major.
    pub values: Vec<f32>,
    /// Whether the scene looks right without it. A program that does not know the name, and whose file does not say what
    /// the attribute does, refuses to show the scene unless this is set.
    pub optional: bool,
}

/// The longest name of an attribute in bytes.
pub const LONGEST_ATTRIBUTE_NAME: usize = 64;

/// Whether a further attribute may have this name.
///
/// ```
/// use light4gs_codec::legal_attribute_name;
///
/// assert!(legal_attribute_name("lifetime"));
/// assert!(!legal_attribute_name("Life time") && !legal_attribute_name("means"));
/// ```
pub fn legal_attribute_name(name: &str) -> bool {
    let legal = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"-_".contains(&byte);
    (1..=LONGEST_ATTRIBUTE_NAME).contains(&name.len()) && name.bytes().all(legal) && !is_built_in(name)
}

/// One attribute of all Gaussians, for code that treats all attributes alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttributeValues<'a> {
    /// The name of the field, or of the [`FurtherAttribute`].
    pub name: &'a str,
    /// Numbers a Gaussian; 0 for `sh_rest` of degree 0.
    pub width: usize,
    /// `[N, width]` row-major.
    pub values: &'a [f32],
    /// Whether the scene looks right without it.
    pub optional: bool,
}

/// How the numbers of an attribute are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Coder {
    /// Plain float32.
    Float32,
    /// Positions on a grid, as a set.
    Grid,
    /// Quantized; each channel is predicted from neighbors and from the channels before.
    Channels,
    /// As [`Coder::Channels`], for red, green, blue: green comes first, since the other two are predicted best from it.
    Colors,
    /// A coder of a newer program.
    Unknown(u8),
}

/// A row of [`BUILT_IN`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BuiltIn {
    pub(crate) name: &'static str,
    pub(crate) width: usize,
    /// Its coder where it is quantized.
    pub(crate) coder: Coder,
    /// The default quantization step.
    pub(crate) step: f32,
}

/// The attributes of every Gaussian of every scene, in the order of a stream. `sh_rest` is not among them: its width
/// depends on the scene, and it has a section of its own.
pub(crate) const BUILT_IN: [BuiltIn; 5] = [
    BuiltIn { name: MEANS, width: 3, coder: Coder::Grid, step: 0.05 },
    BuiltIn { name: "log_scales", width: 3, coder: Coder::Channels, step: 0.1 },
    BuiltIn { name: "quats", width: 4, coder: Coder::Channels, step: 0.02 },
    BuiltIn { name: "opacity_logits", width: 1, coder: Coder::Channels, step: 0.4 },
    BuiltIn { name: "sh_dc", width: 3, coder: Coder::Colors, step: 0.04 },
];

/// The name of the positions.
pub(crate) const MEANS: &str = "means";
/// The name of the harmonics beyond degree 0.
pub(crate) const SH_REST: &str = "sh_rest";

/// Whether the Gaussians of all scenes have an attribute of this name.
pub(crate) fn is_built_in(name: &str) -> bool {
    name == SH_REST || BUILT_IN.iter().any(|row| row.name == name)
}

impl GaussianArrays {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// Every attribute: the built-in ones in the order of the fields, then the further ones in theirs.
    pub fn attributes(&self) -> impl Iterator<Item = AttributeValues<'_>> {
        let Self { means, log_scales, quats, opacity_logits, sh_dc, sh_degree, sh_rest, further } = self;
        let fields: [&[f32]; BUILT_IN.len()] = [
            means.as_flattened(),
            log_scales.as_flattened(),
            quats.as_flattened(),
            opacity_logits,
            sh_dc.as_flattened(),
        ];
        let row = |(row, values): (&'static BuiltIn, _)| AttributeValues {
            name: row.name,
            width: row.width,
            values,
            optional: false,
        };
        let width = 3 * sh_rest_coefficients(*sh_degree);
        let rest = AttributeValues { name: SH_REST, width, values: sh_rest, optional: false };
        BUILT_IN.iter().zip(fields).map(row).chain([rest]).chain(further.iter().map(FurtherAttribute::view))
    }

    /// The Gaussians at these indices, in their order.
    ///
    /// ```
    /// use light4gs_codec::GaussianArrays;
    ///
    /// let gaussians = GaussianArrays { opacity_logits: vec![1.0, 2.0, 3.0], ..GaussianArrays::default() };
    /// # let gaussians = GaussianArrays { means: vec![[0.0; 3]; 3], log_scales: vec![[0.0; 3]; 3], quats: vec![[0.0; 4]; 3], sh_dc: vec![[0.0; 3]; 3], ..gaussians };
    /// assert_eq!(gaussians.gathered(&[2, 0, 2]).opacity_logits, [3.0, 1.0, 3.0]);
    /// ```
    ///
    /// # Panics
    /// If an index is beyond the last Gaussian.
    pub fn gathered(&self, indices: &[u32]) -> Self {
        fn rows<T: Copy>(values: &[T], indices: &[u32]) -> Vec<T> {
            indices.iter().map(|&index| values[index as usize]).collect()
        }
        let wide = |values: &[f32], width: usize| -> Vec<f32> {
            indices.iter().flat_map(|&index| &values[width * index as usize..][..width]).copied().collect()
        };
        let Self { means, log_scales, quats, opacity_logits, sh_dc, sh_degree, sh_rest, further } = self;
        let further = further.iter().map(|FurtherAttribute { name, width, values, optional }| FurtherAttribute {
            name: name.clone(),
            width: *width,
            values: wide(values, *width as usize),
            optional: *optional,
        });
        Self {
            means: rows(means, indices),
            log_scales: rows(log_scales, indices),
            quats: rows(quats, indices),
            opacity_logits: rows(opacity_logits, indices),
            sh_dc: rows(sh_dc, indices),
            sh_degree: *sh_degree,
            sh_rest: wide(sh_rest, 3 * sh_rest_coefficients(*sh_degree)),
            further: further.collect(),
        }
    }

    /// The attribute with a name.
    pub fn attribute(&self, name: &str) -> Option<AttributeValues<'_>> {
        self.attributes().find(|attribute| attribute.name == name)
    }
}

impl FurtherAttribute {
    fn view(&self) -> AttributeValues<'_> {
        let Self { name, width, values, optional } = self;
        AttributeValues { name, width: *width as usize, values, optional: *optional }
    }
}

/// Number of spherical harmonics beyond degree 0 for each channel: `(degree + 1)^2 - 1`.
///
/// ```
/// assert_eq!([0, 1, 2, 3].map(light4gs_codec::sh_rest_coefficients), [0, 3, 8, 15]);
/// ```
pub const fn sh_rest_coefficients(degree: u8) -> usize {
    let side = degree as usize + 1;
    side * side - 1
}
