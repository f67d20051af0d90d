from tests.tiny import *
import time
def test_a(tmp_path):
    lay_out(tmp_path/"p")
    with standing_in(tmp_path/"p"):
        for s in expand(tiny_params()):
            t=time.time(); run_instance(s) if s.name!="report" else None
            print(s.name, round(time.time()-t,2))
        print(*files_below(Path()),sep="\n")
