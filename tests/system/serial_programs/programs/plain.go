// Go without modules; words: the kind of the port, and its path or host:port. It sets no baud rate.
package main

import (
	"fmt"
	"io"
	"net"
	"os"
)

func main() {
	var port io.ReadWriter
	var err error
	if os.Args[1] == "pty" {
		port, err = os.OpenFile(os.Args[2], os.O_RDWR, 0)
	} else {
		port, err = net.Dial("tcp", os.Args[2])
	}
	if err != nil {
		panic(err)
	}
	port.Write([]byte{0x1f, 0x7f, 0x80, 0x1f, 0xff})
	data := make([]byte, 12)
	if _, err = io.ReadFull(port, data); err != nil {
		panic(err)
	}
	fmt.Printf("%x\n", data[2:6])
}
