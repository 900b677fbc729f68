//! The code in the README and in the pages of `docs/` compiles and runs, as doctests.

macro_rules! pages {
    ($($name:ident $path:literal),* $(,)?) => {
        $(
            #[doc = include_str!($path)]
            struct $name;
        )*
    };
}

pages! {
    Readme "../README.md",
    AddATwin "../docs/add-a-twin.md",
    AddAFeatureMap "../docs/add-a-feature-map.md",
    AddAnArchitecture "../docs/add-an-architecture.md",
    AddAnEffect "../docs/add-an-effect.md",
    HowToChoose "../docs/how-to-choose.md",
}
