"""Thins a raw uint8 mask with scikit-image on one thread: skeleton_peer.py FILE NX NY NZ."""
import resource
import sys
import time

import numpy
from skimage.morphology import skeletonize_3d

nx, ny, nz = map(int, sys.argv[2:5])
mask = numpy.fromfile(sys.argv[1], numpy.uint8).reshape(nz, ny, nx)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.process_time()
axis = skeletonize_3d(mask)
seconds = time.process_time() - start
more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
print(f"{seconds:9.3f} s {more:+7.1f} MB  {int((mask > 0).sum()):8} -> {int((axis > 0).sum()):6} voxels")
