# socat; words: the kind of the port, and its path or host:port

case $1 in
    pty) place=FILE:$2,b57600,raw,echo=0 ;;
    *) place=TCP:$2 ;;
esac
{ printf '\037\177\200\037\377'; sleep 20 & wait $!; } | socat -t 20 - "$place" | {
    head -c 6 | tail -c 4 | od -An -tx1 | tr -d ' '
    kill 0
}
