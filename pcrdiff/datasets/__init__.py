"""The layouts of ModelNet40, 3DMatch and KITTI, and how a data set is acquired."""
