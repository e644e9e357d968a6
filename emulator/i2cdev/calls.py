"""What Linux answers to each call that can reach /dev/i2c-N, and what the two routes answer.

The results are those of an unprivileged owner of the file, from the sources of Linux 6.12; a path
that is only a file name is drivers/i2c/i2c-dev.c. ``tests/emulator/i2cdev/calls.c`` makes each
call by both routes; docs/reference/i2c-bus.md has the table.
"""

from dataclasses import dataclass

DEVICE = "i2c-dev.c"


@dataclass(frozen=True)
class LinuxCall:
    """One call, or one use of it."""

    name: str  # the call, as the test program and the documentation name it
    result: str  # the result: a number, or the name of an errno
    source: str  # file and function of Linux that decide it
    seccomp: str = ""  # result with this route, if it is another one
    preload: str = ""


def _rows(source: str, rows: str) -> list[LinuxCall]:
    """One row per line: the call, its result."""
    pairs = (line.rsplit(maxsplit=1) for line in rows.strip().splitlines())
    return [LinuxCall(name.strip(), result, source) for name, result in pairs]


CALLS = (
    *_rows(
        "fs/namei.c do_open, path_openat",
        """
        open of another bus                 ENOENT
        open O_RDWR                         ok
        open O_CREAT                        ok
        open O_CREAT | O_EXCL               EEXIST
        open O_DIRECTORY                    ENOTDIR
        open O_TRUNC                        ok
        open O_PATH                         ok
        openat in /dev                      ok
        openat2                             ok
        open with .. in the path            ok
        open relative to the working folder ok
        open by a symbolic link             ok
        open by a link to a link            ok
        open by a link, O_NOFOLLOW          ELOOP
        open of /proc/self/fd/N             ok
        open takes the lowest free number   ok
        """,
    ),
    *_rows("fs/open.c do_dentry_open", "open O_DIRECT                       EINVAL"),
    *_rows(
        "fs/file.c",
        """
        dup, then ioctl                     2
        dup, then write                     1
        dup2 to a low number, then write    1
        dup2 to a low number, then read     1
        dup3 O_CLOEXEC, then F_GETFD        1
        F_DUPFD to 200                      200
        F_DUPFD_CLOEXEC, then F_GETFD       1
        open O_CLOEXEC, then F_GETFD        1
        close, then ioctl                   EBADF
        close_range, then ioctl             EBADF
        200 opened at once                  200
        open above RLIMIT_NOFILE            EMFILE
        """,
    ),
    LinuxCall("dup2 to 0", "0", "fs/file.c", seccomp="EBADF"),
    *_rows(
        "net/core/scm.c scm_detach_fds",
        """
        ioctl after SCM_RIGHTS              2
        write after SCM_RIGHTS              1
        read after SCM_RIGHTS               1
        """,
    ),
    *_rows(
        "kernel/fork.c, fs/exec.c",
        """
        ioctl in a forked child             2
        write and read after exec           1
        ioctl of four threads at once       800
        """,
    ),
    *_rows(
        "fs/read_write.c",
        """
        write, 1 byte                       1
        read, 1 byte                        1
        read, 0 bytes                       0
        write, 0 bytes                      0
        pwrite                              1
        pread                               1
        pread at a negative offset          EINVAL
        writev of 1 + 2 bytes               3
        readv of 3 + 5 bytes                8
        readv of nothing                    0
        readv of 1025 parts                 EINVAL
        pwritev                             1
        preadv                              1
        preadv2 with RWF_NOWAIT             EOPNOTSUPP
        read of a file opened O_WRONLY      EBADF
        write to a file opened O_RDONLY     EBADF
        read of a file opened O_PATH        EBADF
        lseek                               ESPIPE
        sendfile from the file              EINVAL
        sendfile to the file                EINVAL
        copy_file_range                     EINVAL
        """,
    ),
    *_rows("fs/splice.c", "splice                              EINVAL"),
    *_rows(
        "i2cdev_read, i2cdev_write",
        """
        read, 9000 bytes                    8192
        read before I2C_SLAVE               ENXIO
        read to a bad pointer               EFAULT
        write from a bad pointer            EFAULT
        """,
    ),
    *_rows(
        "fs/select.c, include/linux/poll.h",
        """
        poll for both                       5
        select for reading                  1
        """,
    ),
    *_rows("fs/eventpoll.c do_epoll_ctl", "epoll_ctl ADD                       EPERM"),
    *_rows(
        "fs/fcntl.c",
        """
        F_GETFL of O_RDWR                   2
        F_GETFL of O_RDONLY                 0
        F_GETFL of O_WRONLY                 1
        F_SETFL O_NONBLOCK, then F_GETFL    1
        """,
    ),
    *_rows("fs/locks.c", "flock                               0"),
    *_rows(
        "fs/stat.c, fs/open.c",
        """
        stat: a character device 89:N       ok
        lstat                               ok
        fstat                               ok
        fstatat, empty path                 ok
        statx                               ok
        access R_OK | W_OK                  0
        access X_OK                         EACCES
        access with unknown bits            EINVAL
        readlink                            EINVAL
        readlink of /proc/self/fd/N         ok
        realpath                            ok
        getxattr                            EOPNOTSUPP
        """,
    ),
    *_rows(
        "fs/readdir.c",
        """
        readdir of /dev lists it            1
        readdir again after rewinddir       1
        glob /dev/i2c-*                     1
        scandir of /dev                     1
        """,
    ),
    *_rows(
        "fs/sync.c, fs/open.c, mm/mmap.c",
        """
        fsync                               EINVAL
        ftruncate                           EINVAL
        fallocate                           ENODEV
        mmap                                ENODEV
        """,
    ),
    *_rows(
        "fs/ioctl.c",
        """
        ioctl TCGETS                        ENOTTY
        ioctl FIONREAD                      ENOTTY
        ioctl FIOASYNC                      ENOTTY
        ioctl FIONBIO                       0
        """,
    ),
    *_rows(
        "i2cdev_ioctl",
        """
        I2C_SLAVE                           0
        I2C_SLAVE of 0x80                   EINVAL
        I2C_SLAVE_FORCE                     0
        I2C_SLAVE_FORCE of 0x80             EINVAL
        I2C_TENBIT, then I2C_SLAVE 0x3ff    0
        I2C_SLAVE 0x400, 10-bit             EINVAL
        I2C_PEC                             0
        I2C_RETRIES                         0
        I2C_RETRIES above INT_MAX           EINVAL
        I2C_TIMEOUT                         0
        I2C_TIMEOUT above INT_MAX           EINVAL
        I2C_FUNCS                           0
        I2C_FUNCS to a bad pointer          EFAULT
        I2C_RDWR, file opened O_RDONLY      2
        I2C_RDWR, file opened O_PATH        EBADF
        I2C_RDWR from a bad pointer         EFAULT
        I2C_RDWR with a bad buffer          EFAULT
        I2C_RDWR without messages           EINVAL
        I2C_RDWR, 42 messages               42
        I2C_RDWR, 43 messages               EINVAL
        I2C_RDWR, 8193 bytes                EINVAL
        I2C_SMBUS, unknown size             EINVAL
        I2C_SMBUS, unknown direction        EINVAL
        I2C_SMBUS without data              EINVAL
        I2C_SMBUS from a bad pointer        EFAULT
        I2C_SMBUS byte data                 0
        I2C_SMBUS block of 33 bytes         EINVAL
        unknown request 0x0799              ENOTTY
        """,
    ),
    *_rows(
        "drivers/i2c/i2c-core-base.c",
        """
        I2C_RDWR, address not acknowledged  ENXIO
        I2C_RDWR with I2C_M_NOSTART         EOPNOTSUPP
        read from a 10-bit address          EOPNOTSUPP
        """,
    ),
    *_rows("stdio of the C library", "fopen, fread of 1 byte              1"),
    *_rows("stdio of the C library", "ioctl on fileno                     2"),
    LinuxCall("io_uring_setup", "ok", "io_uring/io_uring.c", seccomp="ENOSYS", preload="ENOSYS"),
)
"""In the order of the documentation. "ok" stands for a result that names nothing, or one that is
compared by the test program: a descriptor, a file status, a path."""
