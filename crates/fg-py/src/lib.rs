//! Python bindings of fg-core, as `fingergait._core`: copy in, release the GIL, copy out; no arithmetic.
#![allow(non_snake_case)] // the paper's letters, as in fg-core
#![allow(clippy::needless_pass_by_value)] // PyO3 hands arguments over by value

use pyo3::prelude::*;

mod allocations;
mod controller;
mod convert;
mod cpu_clock;
mod errors;
mod hand;
mod planner;
mod solver;
mod torque;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    errors::register(module)?;
    module.add_class::<hand::HandModel>()?;
    module.add_class::<controller::Controller>()?;
    module.add_class::<planner::Measurement>()?;
    module.add_class::<planner::Reference>()?;
    module.add_class::<planner::Command>()?;
    module.add_class::<planner::Diagnostics>()?;
    module.add_class::<planner::DualStagePlanner>()?;
    module.add_class::<torque::TorquePid>()?;
    module.add_class::<solver::ForceOptimizer>()?;
    module.add_class::<solver::ForceSolution>()?;
    module.add_class::<solver::LpSolution>()?;
    module.add_function(wrap_pyfunction!(solver::gait_lp, module)?)?;
    module.add_function(wrap_pyfunction!(planner::default_config, module)?)
}
