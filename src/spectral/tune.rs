use std::cell::RefCell;
thread_local!(pub static LOG: RefCell<Vec<(&'static str, f64)>> = RefCell::new(vec![]));
#[repr(C)] struct Ts { s: i64, n: i64 }
unsafe extern "C" { fn clock_gettime(id: i32, t: *mut Ts) -> i32; }
pub fn cpu() -> f64 { let mut t = Ts { s: 0, n: 0 }; unsafe { clock_gettime(3, &mut t) }; t.s as f64 * 1e3 + t.n as f64 * 1e-6 }
pub fn add(name: &'static str, since: f64) { let d = cpu() - since; LOG.with(|l| { let mut l = l.borrow_mut(); if let Some(e) = l.iter_mut().find(|e| e.0 == name) { e.1 += d } else { l.push((name, d)) } }) }
pub fn count(name: &'static str, x: f64) { LOG.with(|l| { let mut l = l.borrow_mut(); if let Some(e) = l.iter_mut().find(|e| e.0 == name) { e.1 += x } else { l.push((name, x)) } }) }
pub fn take() -> Vec<(&'static str, f64)> { LOG.with(|l| std::mem::take(&mut *l.borrow_mut())) }
pub fn env(name: &str, default: f64) -> f64 { std::env::var(name).ok().and_then(|x| x.parse().ok()).unwrap_or(default) }
