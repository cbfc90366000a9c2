from mock_fixtures import mock_arm as mock_arm
from mock_fixtures import stepped_time as stepped_time
