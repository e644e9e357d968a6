// Rust without crates: read and write of the standard library, and ioctl for the address

use std::fs::{File, OpenOptions};
use std::io::{Read, Result, Write};
use std::os::fd::AsRawFd;

extern "C" {
    fn ioctl(fd: i32, request: u64, ...) -> i32;
}

fn fetch(bus: &mut File, address: u64, register: u8, count: usize) -> Result<String> {
    if unsafe { ioctl(bus.as_raw_fd(), 0x0703, address) } < 0 {
        return Err(std::io::Error::last_os_error());
    }
    bus.write_all(&[register])?;
    let mut data = vec![0; count];
    bus.read_exact(&mut data)?;
    Ok(data.iter().map(|byte| format!("{byte:02x}")).collect())
}

fn main() -> Result<()> {
    let path = std::env::args().nth(1).expect("path of the bus");
    let mut bus = OpenOptions::new().read(true).write(true).open(path)?;
    let (data, last) = (fetch(&mut bus, 0x1a, 0x80, 4)?, fetch(&mut bus, 0x1a, 0x83, 1)?);
    let words = match fetch(&mut bus, 0x33, 0x83, 1) {
        Err(error) if error.raw_os_error() == Some(6) => "absent",
        _ => "present",
    };
    println!("{data} {last} {words}");
    Ok(())
}
