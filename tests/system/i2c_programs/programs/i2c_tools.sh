# i2c-tools; words: the path of the bus

bus=${1#/dev/i2c-}
data=$(i2ctransfer -y "$bus" w1@0x1a 0x80 r4 | sed 's/0x//g; s/ //g')
last=$(i2cget -y "$bus" 0x1a 0x83)
i2cget -y "$bus" 0x33 0x83 2>/dev/null || words=absent
echo "$data ${last#0x} ${words:-present}"
