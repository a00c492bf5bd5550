//! The gait LP against its definition: every vertex of the feasible set.
#![allow(clippy::float_cmp)] // bounds are taken over exactly

mod instances;

use fg_core::solver::knapsack::{check, gait_lp};
use instances::Random;

struct Problem {
    c: Vec<f64>,
    a: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// Random numbers among many that coincide: zeros, ties, equal bounds, bounds at zero.
fn problem(random: &mut Random) -> Problem {
    let n = 1 + random.below(5);
    let degenerate = random.below(2) == 0;
    let mut number = |size: f64| {
        if degenerate {
            [-1.0, -0.5, 0.0, 0.0, 0.5, 1.0, 2.0][random.below(7)] * size
        } else {
            random.uniform(-size, size)
        }
    };
    let c = (0..n).map(|_| number(1.0)).collect();
    let a = (0..n).map(|_| number(0.1)).collect();
    let mut lower = Vec::new();
    let mut upper = Vec::new();
    for _ in 0..n {
        let (p, q) = (number(1.0), number(1.0));
        lower.push(p.min(q));
        upper.push(p.max(q));
    }
    Problem { c, a, lower, upper }
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// The best value over all vertices: all variables at a bound but one, which a . x = 0 determines.
fn best_vertex(p: &Problem) -> Option<f64> {
    let n = p.c.len();
    let mut best: Option<f64> = None;
    let mut x = vec![0.0; n];
    for corner in 0..1_usize << n {
        for (i, x) in x.iter_mut().enumerate() {
            *x = if corner >> i & 1 == 1 { p.upper[i] } else { p.lower[i] };
        }
        let mut consider = |x: &[f64]| {
            if dot(&p.a, x).abs() < 1e-12 {
                let value = dot(&p.c, x);
                best = Some(best.map_or(value, |b| b.max(value)));
            }
        };
        consider(&x);
        for i in 0..n {
            if p.a[i] != 0.0 {
                let kept = x[i];
                x[i] -= dot(&p.a, &x) / p.a[i];
                if x[i] >= p.lower[i] - 1e-12 && x[i] <= p.upper[i] + 1e-12 {
                    consider(&x);
                }
                x[i] = kept;
            }
        }
    }
    best
}

/// The smallest |a . x| over the corners of the box: what is left where no x has a . x = 0.
fn smallest_residual(p: &Problem) -> f64 {
    let n = p.c.len();
    (0..1_usize << n)
        .map(|corner| {
            (0..n)
                .map(|i| p.a[i] * if corner >> i & 1 == 1 { p.upper[i] } else { p.lower[i] })
                .sum::<f64>()
                .abs()
        })
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn no_vertex_is_better() {
    let cases = if cfg!(debug_assertions) { 100_000 } else { 1_000_000 };
    let mut random = Random(1);
    let mut infeasible = 0;
    let mut x = [0.0; 8];
    for case in 0..cases {
        let p = problem(&mut random);
        let x = &mut x[..p.c.len()];
        let outcome = gait_lp(&p.c, &p.a, &p.lower, &p.upper, x);
        let inside = x.iter().zip(p.lower.iter().zip(&p.upper)).all(|(x, (l, u))| l <= x && x <= u);
        assert!(inside, "case {case}: {x:?} outside the box");
        let best = best_vertex(&p);
        assert_eq!(outcome.feasible, best.is_some(), "case {case}");
        let residual = dot(&p.a, x).abs();
        if let Some(best) = best {
            assert!((outcome.value - best).abs() <= 1e-12, "case {case}: {} for {best}", outcome.value);
            assert!(residual <= 1e-14, "case {case}: {residual}");
        } else {
            infeasible += 1;
            assert!((residual - smallest_residual(&p)).abs() <= 1e-14, "case {case}: {residual}");
        }
        assert!(
            (outcome.residual.abs() - residual).abs() <= 1e-15
                && (outcome.value - dot(&p.c, x)).abs() <= 1e-15
        );
    }
    assert!((cases / 10..cases / 2).contains(&infeasible), "{infeasible} of {cases} infeasible");
}

#[test]
fn joints_without_effect_on_the_normal_take_their_better_bound() {
    let mut x = [9.0; 4];
    let outcome =
        gait_lp(&[1.0, -1.0, 0.0, 2.0], &[0.0; 4], &[-1.0, -2.0, 0.5, -1.0], &[3.0, 2.0, 2.0, 1.0], &mut x);
    assert_eq!(x, [3.0, -2.0, 0.5, 1.0]);
    assert!(outcome.feasible);
    // 1e-13 of the largest counts as zero, 1e-11 does not.
    gait_lp(&[0.0, 1.0], &[1.0, 1e-13], &[-1.0; 2], &[1.0; 2], &mut x[..2]);
    assert_eq!(x[..2], [0.0, 1.0]);
    let outcome = gait_lp(&[0.0, 1.0], &[1.0, 1e-11], &[-1.0; 2], &[1.0; 2], &mut x[..2]);
    assert!(outcome.residual.abs() < 1e-25 && x[0] < 0.0);
}

#[test]
fn the_current_velocities_are_kept_where_nothing_can_be_gained() {
    let mut x = [1.0; 3];
    let outcome = gait_lp(&[0.0; 3], &[1.0, 2.0, -1.0], &[-0.1; 3], &[0.1; 3], &mut x);
    assert_eq!(x, [0.0; 3]);
    assert!(outcome.feasible && outcome.value == 0.0);
}

#[test]
fn bad_arguments_are_named() {
    let message = |c: &[f64], a: &[f64], l: &[f64], u: &[f64]| check(c, a, l, u).unwrap_err().to_string();
    let one = [1.0, 1.0];
    assert!(check(&one, &one, &[0.0; 2], &one).is_ok());
    assert!(message(&one, &[1.0], &one, &one).starts_with("a: expected shape (2,)"));
    assert!(message(&one, &one, &one, &[1.0; 3]).starts_with("upper:"));
    assert!(message(&[1.0, f64::NAN], &one, &one, &one).starts_with("c[1]: expected a finite number"));
    assert!(message(&one, &one, &one, &[1.0, f64::INFINITY]).starts_with("upper[1]"));
    assert!(message(&one, &one, &[0.0, 2.0], &one).starts_with("lower[1]: expected at most upper[1] = 1"));
}

#[test]
fn careless_arguments_panic_nowhere() {
    let mut x = [0.0; 3];
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308] {
        for i in 0..3 {
            let mut v = [[0.5, -0.5, 1.0], [1.0, 1.0, -1.0], [-1.0; 3], [1.0; 3]];
            for k in 0..4 {
                let kept = v[k][i];
                v[k][i] = bad;
                gait_lp(&v[0], &v[1], &v[2], &v[3], &mut x);
                v[k][i] = kept;
            }
        }
    }
    gait_lp(&[1.0], &[1.0, 2.0], &[], &[1.0; 3], &mut x);
}
