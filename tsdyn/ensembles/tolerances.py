"""Limits of ensembles."""

# s: what a chunk of cases takes, so that handing it out costs nothing and the last ones end together; an ensemble that
# takes less is run without threads of its own, each of which makes arrays of its own
CHUNK_SECONDS = 0.02
# s: the same for an executor, which sends chunks to other processes
SENT_SECONDS = 0.5
# cases of a chunk at most
MOST_CASES = 4096
# of a chunk to the next at most: the first cases are no measure of the others
GROWTH = 8
# chunks in the hands of an executor for each of its workers: none waits for the next
AHEAD = 2
# times that a chunk of a lost worker is sent again
RETRIES = 3
# cases that may wait for one before them until it can be written
WAITING = 1 << 16
# sets of arrays that a thread keeps, one for each selection of redundant rows; studies whose runners a worker keeps
MOST_KEPT = 8
# cases that one thread may run at once
LANES = 1, 4
# cases after which it is asked whether they are long; the loop of cases runs them if fewer than one in FEW_LONG are
TRIED, FEW_LONG = 16, 8
# the first slice of a run is tried alone, and run again if it doesn't suffice, unless one in MOSTLY is long
MOSTLY = 2
