# Perl without modules: read and write, and ioctl for the address

use strict;
use warnings;
use Errno;
use Fcntl;

sysopen(my $bus, $ARGV[0], O_RDWR) or die $!;

sub fetch {
    my ($address, $register, $count) = @_;
    ioctl($bus, 0x0703, $address) or die $!;
    syswrite($bus, chr $register) // return;
    sysread($bus, my $data, $count) // return;
    return unpack "H*", $data;
}

$| = 1;
print fetch(0x1a, 0x80, 4), " ", fetch(0x1a, 0x83, 1), " ";
print defined fetch(0x33, 0x83, 1) ? "present\n" : $!{ENXIO} ? "absent\n" : "$!\n";
