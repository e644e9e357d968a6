# Perl without further modules; words: the kind of the port, and its path or host:port

use strict;
use warnings;
use Fcntl;
use IO::Socket::INET;
use POSIX ();

my $port;
if ($ARGV[0] eq "pty") {
    sysopen($port, $ARGV[1], O_RDWR | O_NOCTTY) or die $!;
    my $settings = POSIX::Termios->new;
    $settings->getattr(fileno $port);
    $settings->setospeed(010001);    # B57600
    $settings->setispeed(010001);
    $settings->setattr(fileno $port, POSIX::TCSANOW) or die $!;
} else {
    $port = IO::Socket::INET->new(PeerAddr => $ARGV[1]) or die $@;
}
syswrite($port, pack "H*", "1f7f801fff") or die $!;
my $data = "";
while (length $data < 12) { sysread($port, $data, 12 - length $data, length $data) or die "end" }
print unpack("H*", substr $data, 2, 4), "\n";
