//! One number for all bits of a decoded scene.

use light4gs_codec::SceneData;

/// FNV-1a over all decoded values, bit by bit. Two scenes with the same digest are equal for the purposes of a test.
/// Native code and WebAssembly must agree.
pub fn digest(scene: &SceneData) -> u64 {
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    let SceneData { gaussians, coordinates, feature_planes, motion, .. } = scene;
    hash.bytes(&[gaussians.sh_degree]);
    gaussians.attributes().for_each(|attribute| hash.floats(attribute.values));
    for attribute in &gaussians.further {
        hash.bytes(attribute.name.as_bytes());
        hash.integers(&[attribute.width]);
    }
    hash.floats(&coordinates.mean);
    hash.floats(coordinates.axes.as_flattened());
    hash.floats(&coordinates.std);
    for plane in &feature_planes.planes {
        hash.integers(&[plane.height, plane.width]);
        hash.floats(&plane.values);
    }
    hash.bytes(motion.kind.as_bytes());
    for layer in motion.network.iter().flat_map(|motion| motion.network.layers()) {
        hash.floats(&layer.weight);
        hash.floats(&layer.bias);
    }
    for tensor in &motion.tensors {
        hash.bytes(tensor.name.as_bytes());
        hash.floats(&tensor.values);
    }
    hash.0
}

struct Fnv(u64);

impl Fnv {
    fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// The number of values, then each.
    fn integers(&mut self, values: &[u32]) {
        self.bytes(&(values.len() as u32).to_le_bytes());
        values.iter().for_each(|value| self.bytes(&value.to_le_bytes()));
    }

    fn floats(&mut self, values: &[f32]) {
        self.bytes(&(values.len() as u32).to_le_bytes());
        values.iter().for_each(|value| self.bytes(&value.to_bits().to_le_bytes()));
    }
}

#[cfg(test)]
mod tests {
    /// The browser test compares the results of WebAssembly with the same list.
    #[test]
    fn golden_streams_have_the_digests_on_record() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let list = std::fs::read_to_string(format!("{root}/bindings/web/tests/data/digests.txt")).expect("the list");
        let digest_of = |name: &str| {
            let bytes = std::fs::read(format!("{root}/tests/golden-streams/{name}.l4gs")).expect("a golden stream");
            format!("{:016x}", super::digest(&light4gs_codec::decode(&bytes).expect("a scene")))
        };
        let names: Vec<&str> = list.lines().filter_map(|line| line.split(' ').next()).collect();
        let found: String = names.iter().map(|name| format!("{name} {}\n", digest_of(name))).collect();
        assert_eq!(list, found);
        for file in std::fs::read_dir(format!("{root}/tests/golden-streams")).expect("the golden streams") {
            let name = file.expect("a file").file_name().into_string().expect("a name");
            let missing = name.strip_suffix(".l4gs").filter(|name| !names.contains(name));
            assert!(missing.is_none(), "{name} is a golden stream without a digest on record");
        }
    }
}
