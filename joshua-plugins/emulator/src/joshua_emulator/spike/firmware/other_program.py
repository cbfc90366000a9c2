# A program of somebody else, for the fault other_program; compiled to other_program.mpy beside it.
from pybricks.tools import wait

n = 0
while True:
    n += 1
    print("S" + str(n) + ",lap", n, "of my own robot; battery is fine *", end="")
    wait(7)
    if n % 3 == 0:
        print()
