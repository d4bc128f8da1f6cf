//! Pages around the player, for `light4gs view`, `light4gs export --html` and the report of a run.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// The player: an ES module that also defines the element `<l4gs-player>`. Made by `bindings/web/build`.
pub const PLAYER: &str = include_str!("../dist/light4gs-player.js");

/// The script of [`TRAINER_PAGE`], an ES module.
pub const TRAINER: &str = include_str!("../dist/light4gs-trainer.js");

/// A page that trains a scene. Beside it stand `light4gs-player.js`, `light4gs-trainer.js` and the program that
/// `bindings/web/build-trainer` makes, `light4gs-web-trainer.wasm`.
pub const TRAINER_PAGE: &str = include_str!("../dist/trainer.html");

const PAGE: &str = include_str!("../dist/page.html");

/// The source of a page's scene.
#[derive(Clone, Copy, Debug)]
pub enum Content<'a> {
    /// From the page itself.
    Embedded {
        /// A `.l4gs` stream.
        scene: &'a [u8],
        /// Cameras as JSON: a list of objects as the player's `DatasetCamera`; `[]` where there are none.
        cameras: &'a str,
    },
    /// From files, as a static server has them.
    Beside {
        /// Address of the `.l4gs` file.
        scene: &'a str,
        /// Of the cameras.
        cameras: &'a str,
    },
    /// From addresses of a server that knows of a newer scene.
    Served {
        /// Of the `.l4gs` stream.
        scene: &'a str,
        /// Of the cameras.
        cameras: &'a str,
        /// Of a JSON text `{"scene": ..., "status": ...}`: whenever `scene` changes it is loaded again.
        watch: &'a str,
    },
}

/// The place of a player in its page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The player fills the page.
    Page,
    /// The player is a part of a page that scrolls.
    Part,
}

/// The element for a scene, which needs [`PLAYER`] in the page.
pub fn element(content: Content, place: Place) -> String {
    let page = if place == Place::Page { " page" } else { "" };
    match content {
        Content::Embedded { scene, cameras } => {
            // Within a script `<` could end it.
            let cameras = cameras.replace('<', "\\u003c");
            let scene = STANDARD.encode(scene);
            format!(
                "<l4gs-player{page} autoplay loop>\n<script type=\"application/json\">{cameras}</script>\n\
                 <script type=\"application/l4gs\">{scene}</script>\n</l4gs-player>"
            )
        }
        Content::Beside { scene, cameras } => {
            let [scene, cameras] = [scene, cameras].map(escape);
            format!("<l4gs-player{page} autoplay loop src=\"{scene}\" cameras=\"{cameras}\"></l4gs-player>")
        }
        Content::Served { scene, cameras, watch } => {
            let [scene, cameras, watch] = [scene, cameras, watch].map(escape);
            format!(
                "<l4gs-player{page} autoplay loop src=\"{scene}\" cameras=\"{cameras}\" watch=\"{watch}\"></l4gs-player>"
            )
        }
    }
}

/// A whole page. `script` is the player's address. Without one the player is embedded, and the page needs no other
/// file.
pub fn page(title: &str, content: Content, script: Option<&str>) -> String {
    let source = script.map(|address| format!(" src=\"{}\"", escape(address)));
    let inside = if script.is_some() { "" } else { PLAYER };
    let parts = [
        ("{{title}}", escape(title)),
        ("{{player}}", element(content, Place::Page)),
        ("{{source}}", source.unwrap_or_default()),
        ("{{script}}", inside.to_owned()),
    ];
    // In the order of the page, so that no value is searched.
    let (mut page, mut rest) = (String::new(), PAGE);
    for (name, value) in parts {
        if let Some((before, after)) = rest.split_once(name) {
            page.push_str(before);
            page.push_str(&value);
            rest = after;
        }
    }
    page + rest
}

/// What programs that show a link read of its page: Open Graph.
#[derive(Clone, Copy, Debug)]
pub struct Preview<'a> {
    /// The name of the scene.
    pub title: &'a str,
    /// A sentence.
    pub description: &'a str,
    /// Address of a picture; most programs want a whole one.
    pub image: &'a str,
    /// Its width and height, pixels.
    pub image_size: [u32; 2],
}

/// A page whose link is shown with a picture.
pub fn with_preview(page: &str, preview: &Preview<'_>) -> String {
    let Preview { title, description, image, image_size: [width, height] } = preview;
    let [title, description, image] = [title, description, image].map(|text| escape(text));
    let head = format!(
        "</title>\n<meta name=\"description\" content=\"{description}\">\n<meta property=\"og:type\" content=\"website\">\n\
         <meta property=\"og:title\" content=\"{title}\">\n<meta property=\"og:description\" content=\"{description}\">\n\
         <meta property=\"og:image\" content=\"{image}\">\n<meta property=\"og:image:width\" content=\"{width}\">\n\
         <meta property=\"og:image:height\" content=\"{height}\">\n<meta name=\"twitter:card\" content=\"summary_large_image\">"
    );
    page.replacen("</title>", &head, 1)
}

/// Text in a form that is safe between tags and in quoted attributes.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_holds_everything_and_nothing_twice() {
        let cameras = "[{\"name\":\"</script>{{source}}\"}]";
        let page = page("a <b> {{player}}", Content::Embedded { scene: b"\x89L4GS", cameras }, None);
        assert!(!page.contains("</script>{{source}}") && page.contains("\\u003c/script>{{source}}"));
        assert!(page.contains("<title>a &lt;b&gt; {{player}}</title>"));
        assert_eq!(page.matches("<l4gs-player page").count(), 1);
        assert!(page.contains("iUw0R1M=") && page.contains(PLAYER));
        assert_eq!(page.matches("</script>").count(), 3, "the module must not end its own element");
    }

    #[test]
    fn a_link_has_a_picture() {
        let content = Content::Beside { scene: "scene.l4gs", cameras: "cameras.json" };
        let page = page("a </title>", content, Some("light4gs-player.js"));
        let preview =
            Preview { title: "a \"b\"", description: "c", image: "https://x/preview.png", image_size: [640, 480] };
        let page = with_preview(&page, &preview);
        assert!(
            page.contains("content=\"a &quot;b&quot;\"")
                && page.contains("og:image\" content=\"https://x/preview.png\"")
        );
        assert!(page.contains("src=\"scene.l4gs\" cameras=\"cameras.json\"></l4gs-player>"));
        assert_eq!(page.matches("</title>").count(), 1);
    }

    #[test]
    fn a_served_page_names_addresses() {
        let content = Content::Served { scene: "scene.l4gs?\"x", cameras: "cameras.json", watch: "state.json" };
        let page = page("x", content, Some("light4gs-player.js"));
        assert!(page.contains("src=\"scene.l4gs?&quot;x\"") && page.contains(" src=\"light4gs-player.js\"></script>"));
        assert!(!page.contains("{{"));
    }
}
