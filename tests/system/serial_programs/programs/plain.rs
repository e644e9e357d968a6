// Rust without crates; words: the kind of the port, and its path or host:port. It sets no baud rate.

use std::fs::OpenOptions;
use std::io::{Read, Result, Write};
use std::net::TcpStream;

fn exchange(mut port: impl Read + Write) -> Result<()> {
    port.write_all(b"\x1f\x7f\x80\x1f\xff")?;
    let mut data = [0; 12];
    port.read_exact(&mut data)?;
    println!("{}", data[2..6].iter().map(|byte| format!("{byte:02x}")).collect::<String>());
    Ok(())
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().collect();
    if words[1] == "pty" {
        exchange(OpenOptions::new().read(true).write(true).open(&words[2])?)
    } else {
        exchange(TcpStream::connect(&words[2])?)
    }
}
