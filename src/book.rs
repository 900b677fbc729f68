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
    EquationsInAFile "../docs/equations.md",
    Estimating "../docs/estimating.md",
    Extending "../docs/extending.md",
}
