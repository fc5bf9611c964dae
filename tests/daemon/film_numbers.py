"""The frames of a numbered film (tests/image/make_film.cpp), as they are found on a glass."""
import numpy

COPIES, BITS = 3, 10
BLOCKS = COPIES * (BITS + 2)


def read_numbers(levels):
    """The number that each copy of the strip shows, from the levels of its blocks; None where it cannot be read."""
    numbers = []
    for copy in numpy.asarray(levels, float).reshape(COPIES, BITS + 2):
        white, black = copy[:2]
        if white - black < 40:
            return None
        bits = copy[2:] > (white + black) / 2
        numbers.append(int(sum(int(bit) << (BITS - 1 - k) for k, bit in enumerate(bits))))
    return numbers


def is_torn(numbers):
    return numbers is not None and len(set(numbers)) > 1


def unwrap(numbers, first, frames):
    """Numbers of a film that begins again after so many frames, counted on from the first. A step back by less than half
    the film stays one."""
    counted = []
    for number in numbers:
        before = counted[-1] if counted else first
        counted.append(before + (number - before + frames // 2) % frames - frames // 2)
    return counted
