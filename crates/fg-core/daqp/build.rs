//! Compiles DAQP from `DAQP_SOURCE`, the folder of its source distribution, with the optimisation that its own build asks for.

const FILES: [&str; 11] = [
    "api",
    "avi",
    "auxiliary",
    "bnb",
    "daqp",
    "daqp_prox",
    "eq_elim",
    "factorization",
    "hierarchical",
    "presolve",
    "utils",
];

fn main() {
    println!("cargo:rerun-if-env-changed=DAQP_SOURCE");
    println!("cargo:rerun-if-changed=src/shim.c");
    let Ok(source) = std::env::var("DAQP_SOURCE") else {
        panic!("DAQP_SOURCE: expected the folder of daqp-0.11.0.tar.gz, unpacked; run: make daqp");
    };
    let mut build = cc::Build::new();
    build.files(FILES.map(|file| format!("{source}/csrc/src/{file}.c"))).file("src/shim.c");
    build.include(format!("{source}/csrc/include")).opt_level(3).warnings(false);
    build.flag("-fassociative-math").flag("-fno-signed-zeros").flag("-fno-trapping-math");
    build.compile("daqp");
}
