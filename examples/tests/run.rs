//! Runs every example, as a module of this program: programs of their own would each be linked with Burn.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use light4gs_examples::Outcome;

/// Makes a module, a test and an entry of [`EXAMPLES`] of each file in `examples/`.
macro_rules! examples {
    ($($name:ident)*) => {
        #[path = "../examples"]
        mod examples {
            $(pub(crate) mod $name;)*
        }

        const EXAMPLES: &[&str] = &[$(stringify!($name)),*];

        $(
            #[test]
            fn $name() -> Outcome {
                alone(examples::$name::main)
            }
        )*
    };
}

examples! {
    own_context_part
    own_dataset_layout
    own_deformation_field
    own_density_strategy
    own_frame_sampler
    own_gaussian_attribute
    own_loss
    own_planes
    own_regularizer
    own_rigid_motion
    own_sh_entropy_model
    own_significance_score
    own_training_loop
    own_uncoded_motion
}

/// One example at a time. Burn has one random generator for the whole process: another example would draw from it in
/// between, and a resumed run would not give the same bits.
fn alone(example: fn() -> Outcome) -> Outcome {
    static RUNNING: Mutex<()> = Mutex::new(());
    let _running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
    example()
}

/// The list above, the index of the examples and the table of docs/extending.md name each file in `examples/`, and only
/// those.
#[test]
fn no_example_is_left_out() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut names: Vec<String> = files
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names, EXAMPLES);
    let index = include_str!("../README.md");
    let table = include_str!("../../docs/extending.md");
    for name in EXAMPLES {
        assert!(index.contains(&format!("(examples/{name}.rs)")), "examples/README.md does not name {name}");
        assert!(
            table.contains(&format!("[{name}](../examples/examples/{name}.rs)")),
            "docs/extending.md has no row for {name}"
        );
    }
    assert_eq!(index.matches("(examples/").count(), EXAMPLES.len());
}

/// Code that docs/extending.md quotes from an example stands in that example, line for line.
#[test]
fn quoted_code_is_the_examples() {
    let document = include_str!("../../docs/extending.md");
    let lines = |text: &str| text.lines().map(|line| line.trim().to_owned() + "\n").collect::<String>();
    let mut quotes = 0;
    for quote in document.split("<!-- quoted from ").skip(1) {
        let (name, rest) = quote.split_once(" -->").expect("a comment has an end");
        let code = rest.split("```rust\n").nth(1).and_then(|code| code.split("```").next()).expect("code follows");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("examples/{name}.rs"));
        let example = std::fs::read_to_string(&path).unwrap();
        assert!(lines(&example).contains(&lines(code)), "not in {}:\n{code}", path.display());
        quotes += 1;
    }
    assert!(quotes > 0);
}
