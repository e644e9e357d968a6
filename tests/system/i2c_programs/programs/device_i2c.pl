# Perl's Device::I2C

use strict;
use warnings;
use Device::I2C;
use Fcntl;

my $bus = Device::I2C->new($ARGV[0], O_RDWR) or die $!;
$bus->selectDevice(0x1a);
my @data = $bus->readBlockData(0x80, 4);
printf "%s %02x ", join("", map { sprintf "%02x", $_ } @data), $bus->readByteData(0x83);
$bus->selectDevice(0x33);
print $bus->readByteData(0x83) == -1 && $!{ENXIO} ? "absent\n" : "$!\n";
