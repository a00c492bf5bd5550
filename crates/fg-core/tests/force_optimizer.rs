//! The force optimiser on problems like those of a hand at work.
#![allow(non_snake_case)]

mod instances;

use fg_core::manipulation::force::{ForceOptimizer, ForceSettings, ForceStatus, SolverChoice, SolverUsed};
use instances::{Random, Sequence, FAMILIES};
use nalgebra::DVector;

#[test]
fn active_set_agrees_with_polished_clarabel() {
    let mut random = Random(1);
    let mut fast_counts = [0_u32; 4];
    let mut worst = 0.0_f64;
    for (family, n, edges) in FAMILIES
        .iter()
        .flat_map(|f| [(3, 4), (4, 8), (3, 8), (4, 6), (2, 5), (5, 12)].map(|(n, m)| (*f, n, m)))
    {
        let sequence = Sequence::new(&mut random, family, n, edges);
        let settings = ForceSettings { solver: SolverChoice::Clarabel, ..ForceSettings::default() };
        let mut fast = ForceOptimizer::new(&sequence.pyramids, 3 * n, ForceSettings::default()).unwrap();
        let mut slow = ForceOptimizer::new(&sequence.pyramids, 3 * n, settings).unwrap();
        let mut f_prev = DVector::zeros(3 * n);
        for k in 0..Sequence::LENGTH {
            let instance = sequence.at(k, &f_prev);
            let a = fast.solve(&instance.problem()).unwrap();
            let b = slow.solve(&instance.problem()).unwrap();
            fast_counts[a.solver as usize] += 1;
            let error = (&a.f - &b.f).norm();
            if b.status == ForceStatus::Solved && b.solver != SolverUsed::Clarabel {
                worst = worst.max(error);
            }
            f_prev.copy_from(&a.f);
        }
    }
    assert!(worst < 1e-6, "{worst:e}");
    assert!(fast_counts[1] <= 30 && fast_counts[2..] == [0, 0], "{fast_counts:?}");
}
