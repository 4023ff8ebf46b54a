// SPDX-License-Identifier: MIT OR Apache-2.0
//! The functions of `voidage.h`: null checks, panics caught, errors kept for `voidage_last_error`.
//!
//! Safety rule of this file: pointers come from the caller as documented in the header; every function
//! checks for null before it looks, and nothing it hands out outlives the message it belongs to.
#![allow(non_camel_case_types, clippy::missing_safety_doc)]

use crate::link::{Link, Me};
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use voidage_wire::{Block, ElementType, Role};

/// The connection of this process; opaque.
pub struct voidage_link(Link);

/// An array of a message to be begun.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct voidage_block {
    /// one of the array names above
    pub field: u32,
    /// VOIDAGE_F64, VOIDAGE_I64 or VOIDAGE_U8
    pub r#type: u32,
    /// elements, not bytes; 3 n for a vector array
    pub count: u64,
}

const _: () = assert!(size_of::<voidage_block>() == 16 && std::mem::offset_of!(voidage_block, count) == 8);

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::new(CString::default());
}

/// Runs `f`; an error or a panic becomes the last error and `bad`.
fn guard<R>(bad: R, f: impl FnOnce() -> Result<R, String>) -> R {
    let reason = match catch_unwind(AssertUnwindSafe(f)) {
        Ok(Ok(r)) => return r,
        Ok(Err(e)) => e,
        Err(p) => {
            let text = p.downcast_ref::<String>().map(String::as_str).or(p.downcast_ref::<&str>().copied());
            format!("internal error of voidage: {}", text.unwrap_or("panic"))
        }
    };
    LAST_ERROR.with(|e| *e.borrow_mut() = CString::new(reason.replace('\0', " ")).unwrap_or_default());
    bad
}

/// The link behind a pointer.
///
/// # Safety
/// `link` is null or comes from `voidage_open` and was not closed.
unsafe fn body<'a>(link: *mut voidage_link) -> Result<&'a mut Link, String> {
    // SAFETY: by this function's contract; one thread uses the link, so the reference is unique
    unsafe { link.as_mut() }.map(|l| &mut l.0).ok_or_else(|| "the link is NULL: voidage_open failed?".into())
}

/// Text behind a pointer.
///
/// # Safety
/// `text` is null or ends with NUL.
unsafe fn text(text: *const c_char) -> Result<String, String> {
    if text.is_null() {
        return Err("a text is NULL".into());
    }
    // SAFETY: not null, and NUL-terminated by this function's contract
    Ok(unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
}

/// The message of the last failure in this thread, never NULL; valid until the next failure.
#[unsafe(no_mangle)]
pub extern "C" fn voidage_last_error() -> *const c_char {
    LAST_ERROR.with(|e| e.borrow().as_ptr())
}

/// Connects to the coupler of the run named by $VOIDAGE_SESSION and exchanges the handshake; every rank
/// must call it. role: VOIDAGE_DEM or VOIDAGE_CFD; rank, size: of this program's MPI world; time_step: own,
/// s; step, time: step number and physical time (s) at which this program starts; program: name and
/// version, for messages. NULL on failure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_open(
    role: i32,
    rank: i32,
    size: i32,
    time_step: f64,
    step: i64,
    time: f64,
    program: *const c_char,
) -> *mut voidage_link {
    guard(std::ptr::null_mut(), || {
        // SAFETY: the header asks for a NUL-terminated text
        let program = unsafe { text(program) }?;
        let role = match role {
            1 => Role::Dem,
            2 => Role::Cfd,
            _ => return Err(format!("role {role}: use VOIDAGE_DEM or VOIDAGE_CFD")),
        };
        let number = |n: i32| u32::try_from(n).map_err(|_| format!("rank {rank} of {size}"));
        let me =
            Me { role, rank: number(rank)?, size: number(size)?, time_step, step, time, program: &program };
        Ok(Box::into_raw(Box::new(voidage_link(Link::open(&me)?))))
    })
}

/// A number told by the coupler, e.g. "fluid.density"; 0 if known, negative if there is no such name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_setting(
    link: *mut voidage_link,
    name: *const c_char,
    value: *mut f64,
) -> i32 {
    guard(-1, || {
        // SAFETY: pointers as the header asks
        let (link, name) = unsafe { (body(link)?, text(name)?) };
        let number = link.setting(&name).ok_or(format!("the coupler told no setting {name:?}"))?;
        // SAFETY: null is refused, else the caller's f64
        *unsafe { value.as_mut() }.ok_or("value is NULL")? = number;
        Ok(0)
    })
}

/// Starts a message: room for all arrays is made in the shared segment (zeroed).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_begin(
    link: *mut voidage_link,
    kind: i32,
    step: i64,
    time: f64,
    blocks: *const voidage_block,
    n_blocks: usize,
) -> i32 {
    guard(-1, || {
        if blocks.is_null() && n_blocks > 0 {
            return Err("blocks is NULL".into());
        }
        // SAFETY: not null (or empty), n_blocks elements by the header
        let list = if n_blocks == 0 { &[] } else { unsafe { std::slice::from_raw_parts(blocks, n_blocks) } };
        let convert = |b: &voidage_block| {
            let of = ElementType::from_code(b.r#type).ok_or(format!("element type {}", b.r#type))?;
            Ok(Block { field: b.field, of, count: usize::try_from(b.count).map_err(|e| e.to_string())? })
        };
        let list = list.iter().map(convert).collect::<Result<Vec<_>, String>>()?;
        // SAFETY: pointer as the header asks
        unsafe { body(link)? }.begin(kind as u32, step, time, &list)?;
        Ok(0)
    })
}

/// Where to write an array of the message begun; NULL if it was not declared.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_array(link: *mut voidage_link, field: u32) -> *mut c_void {
    guard(std::ptr::null_mut(), || {
        // SAFETY: pointer as the header asks
        let array = unsafe { body(link)? }.array(field);
        Ok(array.ok_or(format!("array {field} was not declared in voidage_begin"))?.as_mut_ptr().cast())
    })
}

/// Sends the message begun.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_send(link: *mut voidage_link) -> i32 {
    // SAFETY: pointer as the header asks
    guard(-1, || unsafe { body(link)? }.send().map(|()| 0))
}

/// Waits for the next message: returns its kind, or a negative number. VOIDAGE_STOP can come in place of
/// any other: the run has ended (voidage_stop_reason() is empty) or must stop (it says why).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_receive(link: *mut voidage_link) -> i32 {
    // SAFETY: pointer as the header asks
    guard(-1, || unsafe { body(link)? }.receive().map(|k| k as i32))
}

/// Exchange number of the message received.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_step(link: *mut voidage_link) -> i64 {
    // SAFETY: pointer as the header asks
    guard(-1, || unsafe { body(link)? }.frame().map(|f| f.step()))
}

/// Physical time of the message received, s.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_time(link: *mut voidage_link) -> f64 {
    // SAFETY: pointer as the header asks
    guard(f64::NAN, || unsafe { body(link)? }.frame().map(|f| f.time()))
}

/// Where to read an array of the message received, and its length; NULL if it is not there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_read(link: *mut voidage_link, field: u32, count: *mut u64) -> *const c_void {
    guard(std::ptr::null(), || {
        // SAFETY: pointer as the header asks
        let frame = unsafe { body(link)? }.frame()?;
        let (words, _, n) = frame.raw(field).ok_or(format!("array {field} is not in this message"))?;
        // SAFETY: null is allowed, else the caller's number
        if let Some(count) = unsafe { count.as_mut() } {
            *count = n as u64;
        }
        Ok(words.as_ptr().cast())
    })
}

/// Why the run ends, after VOIDAGE_STOP; empty if it is complete. Valid until the next receive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_stop_reason(link: *mut voidage_link) -> *const c_char {
    // SAFETY: pointer as the header asks
    guard(c"the link is NULL".as_ptr(), || Ok(unsafe { body(link)? }.stop_reason().as_ptr()))
}

/// Gives the message received back; pointers into it end here.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_release(link: *mut voidage_link) -> i32 {
    guard(-1, || {
        // SAFETY: pointer as the header asks
        unsafe { body(link)? }.release();
        Ok(0)
    })
}

/// Tells the coupler why this program gives up (best effort, never blocks long).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_fail(link: *mut voidage_link, reason: *const c_char) {
    guard((), || {
        // SAFETY: pointers as the header asks
        unsafe { body(link)?.fail(&text(reason)?) };
        Ok(())
    });
}

/// Ends the connection; NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn voidage_close(link: *mut voidage_link) {
    guard((), || {
        if !link.is_null() {
            // SAFETY: from voidage_open, and the caller gives it up here
            drop(unsafe { Box::from_raw(link) });
        }
        Ok(())
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn null_and_panics_are_errors_with_a_message() {
        let none = std::ptr::null_mut();
        // SAFETY: valid until the next failure, and copied at once
        let last = || unsafe { CStr::from_ptr(voidage_last_error()) }.to_string_lossy().into_owned();
        // SAFETY: null is what is tested
        unsafe {
            assert_eq!(voidage_send(none), -1);
            assert!(last().contains("voidage_open failed"));
            assert_eq!(voidage_receive(none), -1);
            assert!(
                voidage_array(none, 1).is_null() && voidage_read(none, 1, std::ptr::null_mut()).is_null()
            );
            assert!(voidage_open(1, 0, 1, 1e-5, 0, 0.0, std::ptr::null()).is_null());
            assert!(last().contains("NULL"));
            assert!(voidage_open(7, 0, 1, 1e-5, 0, 0.0, c"x".as_ptr()).is_null());
            assert!(last().contains("VOIDAGE_DEM"));
            assert!(voidage_open(1, 0, 1, 1e-5, 0, 0.0, c"x".as_ptr()).is_null());
            assert!(last().contains("voidage run CASE"), "{}", last());
            voidage_close(none);
        }
        assert_eq!(guard(-7, || panic!("boom")), -7);
        assert!(last().contains("boom"));
    }
}
