"""What instruments and people write, turned into measurement tables: text and workbooks of any layout."""
