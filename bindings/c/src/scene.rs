//! The open scene.

use std::ffi::CString;

use light4gs_codec::SectionInfo;
use light4gs_render::PlayableScene;

use crate::failure::c_string;

/// An open scene. It does not change until it is closed.
#[derive(Debug)]
pub struct L4gsScene {
    pub(crate) playable: PlayableScene,
    pub(crate) name: CString,
    /// Key and value.
    pub(crate) extras: Vec<(CString, CString)>,
    /// Names of the further attributes.
    pub(crate) attributes: Vec<CString>,
    /// Name and bytes.
    pub(crate) sections: Vec<(CString, u64)>,
}

impl L4gsScene {
    pub(crate) fn new(playable: PlayableScene) -> Self {
        let info = playable.info();
        let name = c_string(&info.meta.name);
        let extras = info.meta.extra.iter().map(|(key, value)| (c_string(key), c_string(value))).collect();
        let sections = SectionInfo::bytes_by_name(&info.sections);
        let sections = sections.into_iter().map(|(name, bytes)| (c_string(name), bytes)).collect();
        let attributes = playable.further().iter().map(|attribute| c_string(&attribute.name)).collect();
        Self { name, extras, attributes, sections, playable }
    }
}

// Several threads may use one scene.
const _: () = {
    const fn shared<T: Send + Sync>() {}
    shared::<L4gsScene>();
};
