//! Links Embree if its adapter is compiled.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_EMBREE").is_some() {
        // Debian's package has no pkg-config file: the linker finds it in its own folders.
        println!("cargo::rustc-link-lib=dylib=embree3");
    }
}
