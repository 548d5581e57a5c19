import sys

sys.path.insert(0, sys.argv[1] + "/tests/campaign")
import random_campaign as rc

for n in map(int, sys.argv[2].split(",")):
    print(n, [(k, t[:110]) for k, t in rc.judged("plain", n)[0]], flush=True)
