//! Runs the control step at its rate in real time, on recorded measurements, for as long as asked, and tells how late and
//! how long the steps were.
//!
//! ```text
//! cargo run --release --example soak -- [--seconds N] [--rate HZ]
//! ```
//!
//! Where permitted it runs under SCHED_FIFO with its memory locked. The histogram counts wall-clock time from the moment a
//! step was due to the moment its command was ready, so what the operating system and the hypervisor do to it is in there;
//! how late the thread was woken, and the time that the step itself took on the processor, are given beside it. Exit status
//! 1: deadlines were missed.
#![allow(missing_docs, non_snake_case)]
#![allow(unsafe_code)] // system calls that the standard library lacks

#[path = "../benches/recording/mod.rs"]
mod recording;
mod thread_clock;

use recording::{Recording, ROTATE};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use thread_clock::thread_ns;

/// Upper edges of the histogram's classes, microseconds.
const EDGES: [u64; 12] = [5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, u64::MAX];

/// What the steps were like.
#[derive(Default)]
struct Report {
    latency: [u64; EDGES.len()],
    steps: u64,
    missed: u64,
    /// Of those missed: the thread was woken when its deadline had passed.
    overslept: u64,
    worst_us: u64,
    worst_wake_us: u64,
    cpu_ns: u64,
    worst_cpu_ns: u64,
}

impl Report {
    fn note(&mut self, woken: Duration, late: Duration, cpu_ns: u64) {
        let us = u64::try_from(late.as_micros()).unwrap_or(u64::MAX);
        self.latency[EDGES.iter().position(|edge| us < *edge).unwrap_or(EDGES.len() - 1)] += 1;
        self.steps += 1;
        self.worst_us = self.worst_us.max(us);
        self.worst_wake_us = self.worst_wake_us.max(u64::try_from(woken.as_micros()).unwrap_or(u64::MAX));
        self.cpu_ns += cpu_ns;
        self.worst_cpu_ns = self.worst_cpu_ns.max(cpu_ns);
    }

    fn print(&self, period: Duration) {
        println!("{:>18} {:>10}", "latency, us", "steps");
        let mut low = 0;
        for (edge, count) in EDGES.iter().zip(&self.latency) {
            let to = if *edge == u64::MAX { "..".into() } else { format!("{edge}") };
            println!("{:>18} {count:>10}", format!("{low} to {to}"));
            low = *edge;
        }
        let Self { steps, missed, worst_us, .. } = self;
        println!(
            "{steps} steps, {missed} deadlines of {} us missed, worst {worst_us} us",
            period.as_micros()
        );
        println!(
            "woken late: worst {} us; {} of the missed deadlines had passed by then",
            self.worst_wake_us, self.overslept
        );
        println!(
            "processor time: mean {} ns, worst {} ns",
            self.cpu_ns / self.steps.max(1),
            self.worst_cpu_ns
        );
    }
}

fn main() -> ExitCode {
    let argument = |name: &str, default: f64| {
        let mut arguments = std::env::args().skip_while(|argument| argument != name);
        arguments.nth(1).and_then(|value| value.parse().ok()).unwrap_or(default)
    };
    let (seconds, rate) = (argument("--seconds", 10.0), argument("--rate", 500.0));
    println!("scheduling: {}; memory: {}", real_time(), lock_memory());
    let recording = Recording::parse(ROTATE);
    let mut planner = recording.planner();
    let period = Duration::from_secs_f64(1.0 / rate);
    let mut report = Report::default();
    let resident = resident_kib();
    let begin = Instant::now();
    let mut due = begin;
    'soak: loop {
        for (measurement, reference) in &recording.rows {
            if begin.elapsed().as_secs_f64() >= seconds {
                break 'soak;
            }
            due += period;
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            let woken = due.elapsed();
            let cpu = thread_ns();
            let outcome = planner.step(measurement, reference);
            assert!(outcome.is_ok_and(|command| command.tau.iter().all(|tau| tau.is_finite())));
            let cpu = thread_ns() - cpu;
            let late = due.elapsed();
            report.note(woken, late, cpu);
            if late > period {
                report.missed += 1;
                report.overslept += u64::from(woken > period);
                // Steps that could not be made in time are gone; the next one is due in the future.
                due += period * u32::try_from(late.as_nanos() / period.as_nanos()).unwrap_or(0);
            }
        }
        planner.reset();
    }
    report.print(period);
    println!("resident memory: {} KiB at the start, {} KiB at the end", resident, resident_kib());
    ExitCode::from(u8::from(report.missed > 0))
}

/// Asks for SCHED_FIFO.
fn real_time() -> &'static str {
    let parameters = libc::sched_param { sched_priority: 80 };
    // SAFETY: plain system call on this process with a valid structure.
    let refused = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } != 0;
    if refused {
        "as any process (SCHED_FIFO not permitted)"
    } else {
        "SCHED_FIFO, priority 80"
    }
}

/// Asks for memory that is never paged out.
fn lock_memory() -> &'static str {
    // SAFETY: plain system call without arguments in memory.
    let refused = unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } != 0;
    if refused {
        "not locked (not permitted)"
    } else {
        "locked"
    }
}

/// Resident memory of this process, KiB; zero where the system does not say.
fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    line.and_then(|line| line.split_whitespace().nth(1)).and_then(|kib| kib.parse().ok()).unwrap_or(0)
}
