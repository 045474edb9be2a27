"""Detection and tracking of people in lidar scans."""
