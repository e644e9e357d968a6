// Go without modules: read and write, and ioctl for the address
package main

import (
	"fmt"
	"os"
	"syscall"
)

func fetch(bus *os.File, address, register, count int) ([]byte, error) {
	_, _, failure := syscall.Syscall(syscall.SYS_IOCTL, bus.Fd(), 0x0703, uintptr(address))
	if failure != 0 {
		return nil, failure
	}
	if _, err := bus.Write([]byte{byte(register)}); err != nil {
		return nil, err
	}
	data := make([]byte, count)
	_, err := bus.Read(data)
	return data, err
}

func main() {
	bus, err := os.OpenFile(os.Args[1], os.O_RDWR, 0)
	if err != nil {
		panic(err)
	}
	data, _ := fetch(bus, 0x1a, 0x80, 4)
	last, _ := fetch(bus, 0x1a, 0x83, 1)
	_, err = fetch(bus, 0x33, 0x83, 1)
	words := "present"
	if failure, ok := err.(*os.PathError); ok && failure.Err == syscall.ENXIO {
		words = "absent"
	}
	fmt.Printf("%x %x %s\n", data, last, words)
}
